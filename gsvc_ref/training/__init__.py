"""Training: how the splats of a frame are found (paper sections 3.4 to 3.8).

Read `loop` first: evaluate, add, step, remove, stop? It is the loop of `fit`, which trains a `population` of splats,
and of `fine_tuning`, which trains them through the quantisers that a decoder will have: `frame_quantizer`, then
`block_quantizer` and its kernels in `straight_through`.

The parts of an iteration are `weighting` (the colours w c'), `events` (splats come by `augmentation`, GSA, and go by
`pruning`, GSP), `adan` (the step), `schedule` (its rates) and `convergence`. All choices are in `settings`.

Preset `quick` has another way. `coordinates` are what the encoders measure changes of splats in, since those of the
same length cost the picture about the same; `descent` is L-BFGS in them, `walk` its way over a picture's splats, and
`descending` the fit of a frame, at the sizes of `coarse`, with new splats along `edges`. `staged_rounding` makes codes,
with the colours and the feedback of the Gram matrix in `gram`.
"""

from gsvc_ref.training.adan import Adan, AdanSettings
from gsvc_ref.training.augmentation import KEPT_WEIGHT, NEW_WEIGHT, image_start, random_splats, uniform_numbers
from gsvc_ref.training.convergence import Convergence, ConvergenceTest
from gsvc_ref.training.events import new_splats
from gsvc_ref.training.fine_tuning import fine_tune
from gsvc_ref.training.fitting import fit, quantised
from gsvc_ref.training.frame_quantizer import FrameQuantizer
from gsvc_ref.training.loop import MIN_FACTOR, OnIteration
from gsvc_ref.training.population import NEW, Population
from gsvc_ref.training.pruning import PruningSchedule
from gsvc_ref.training.psnr import loss_of_psnr, psnr_of_loss
from gsvc_ref.training.schedule import PAPER_SCHEDULE, Constant, Cosine, Schedule, StepDecay
from gsvc_ref.training.settings import (
    MAX_ITERATIONS,
    AnyFit,
    BlockSettings,
    DescentSettings,
    FitSettings,
    Growth,
    Rates,
    RoundingSettings,
)
from gsvc_ref.training.staged_rounding import round_in_stages

__all__ = [
    "KEPT_WEIGHT",
    "MAX_ITERATIONS",
    "MIN_FACTOR",
    "NEW",
    "NEW_WEIGHT",
    "PAPER_SCHEDULE",
    "Adan",
    "AdanSettings",
    "AnyFit",
    "BlockSettings",
    "Constant",
    "Convergence",
    "ConvergenceTest",
    "Cosine",
    "DescentSettings",
    "FitSettings",
    "FrameQuantizer",
    "Growth",
    "OnIteration",
    "Population",
    "PruningSchedule",
    "Rates",
    "RoundingSettings",
    "Schedule",
    "StepDecay",
    "fine_tune",
    "fit",
    "image_start",
    "loss_of_psnr",
    "new_splats",
    "psnr_of_loss",
    "quantised",
    "random_splats",
    "round_in_stages",
    "uniform_numbers",
]

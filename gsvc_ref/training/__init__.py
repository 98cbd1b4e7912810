"""Training: how the splats of a frame are found (paper sections 3.4 to 3.8).

Read `loop` first: evaluate, add, step, remove, stop? It is the loop of `fit`, which trains a `population` of splats,
and of `fine_tuning`, which trains them through the quantisers that a decoder will have: `frame_quantizer`, then
`block_quantizer` and its kernels in `straight_through`.

The parts of an iteration are `weighting` (the colours w c'), `adan` (the step), `schedule` (its rates) and
`convergence`. Between iterations splats go by `pruning` (GSP); before the first one they come by `augmentation` (GSA).
All choices are in `settings`.
"""

from gsvc_ref.training.adan import Adan, AdanSettings
from gsvc_ref.training.augmentation import KEPT_WEIGHT, NEW_WEIGHT, random_splats, uniform_numbers
from gsvc_ref.training.convergence import Convergence, ConvergenceTest
from gsvc_ref.training.fine_tuning import fine_tune
from gsvc_ref.training.fitting import fit
from gsvc_ref.training.frame_quantizer import FrameQuantizer
from gsvc_ref.training.loop import MIN_FACTOR, OnIteration
from gsvc_ref.training.population import NEW, Population
from gsvc_ref.training.pruning import PruningSchedule
from gsvc_ref.training.psnr import loss_of_psnr, psnr_of_loss
from gsvc_ref.training.schedule import PAPER_SCHEDULE, Constant, Cosine, Schedule, StepDecay
from gsvc_ref.training.settings import (
    MAX_ITERATIONS,
    BlockSettings,
    FitSettings,
    Rates,
)

__all__ = [
    "KEPT_WEIGHT",
    "MAX_ITERATIONS",
    "MIN_FACTOR",
    "NEW",
    "NEW_WEIGHT",
    "PAPER_SCHEDULE",
    "Adan",
    "AdanSettings",
    "BlockSettings",
    "Constant",
    "Convergence",
    "ConvergenceTest",
    "Cosine",
    "FitSettings",
    "FrameQuantizer",
    "OnIteration",
    "Population",
    "PruningSchedule",
    "Rates",
    "Schedule",
    "StepDecay",
    "fine_tune",
    "fit",
    "loss_of_psnr",
    "psnr_of_loss",
    "random_splats",
    "uniform_numbers",
]

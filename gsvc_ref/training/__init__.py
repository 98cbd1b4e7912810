"""Training: how the splats of a frame are found (paper sections 3.4 to 3.8).

Read `loop` first: evaluate, add, step, remove, stop? It is the loop of `fit`, which trains a `population` of splats,
and of `fine_tuning`, which trains them through the quantisers that a decoder will have: `frame_quantizer`, then
`block_quantizer` and its kernels in `straight_through`.

The parts of an iteration are `weighting` (the colours w c'), `adan` (the step), `schedule` (its rates) and
`convergence`. Between iterations splats go by `pruning` (GSP); before the first one they come by `augmentation` (GSA).
All choices are in `settings`.
"""

from gsvc_ref.training.adan import Adan as Adan
from gsvc_ref.training.adan import AdanSettings as AdanSettings
from gsvc_ref.training.augmentation import KEPT_WEIGHT as KEPT_WEIGHT
from gsvc_ref.training.augmentation import NEW_WEIGHT as NEW_WEIGHT
from gsvc_ref.training.augmentation import random_splats as random_splats
from gsvc_ref.training.augmentation import uniform_numbers as uniform_numbers
from gsvc_ref.training.convergence import Convergence as Convergence
from gsvc_ref.training.convergence import ConvergenceTest as ConvergenceTest
from gsvc_ref.training.fine_tuning import fine_tune as fine_tune
from gsvc_ref.training.fitting import fit as fit
from gsvc_ref.training.frame_quantizer import FrameQuantizer as FrameQuantizer
from gsvc_ref.training.loop import MIN_FACTOR as MIN_FACTOR
from gsvc_ref.training.loop import OnIteration as OnIteration
from gsvc_ref.training.population import NEW as NEW
from gsvc_ref.training.population import Population as Population
from gsvc_ref.training.pruning import PruningSchedule as PruningSchedule
from gsvc_ref.training.psnr import loss_of_psnr as loss_of_psnr
from gsvc_ref.training.psnr import psnr_of_loss as psnr_of_loss
from gsvc_ref.training.schedule import PAPER_SCHEDULE as PAPER_SCHEDULE
from gsvc_ref.training.schedule import Constant as Constant
from gsvc_ref.training.schedule import Cosine as Cosine
from gsvc_ref.training.schedule import Schedule as Schedule
from gsvc_ref.training.schedule import StepDecay as StepDecay
from gsvc_ref.training.settings import MAX_ITERATIONS as MAX_ITERATIONS
from gsvc_ref.training.settings import BlockSettings as BlockSettings
from gsvc_ref.training.settings import FitSettings as FitSettings
from gsvc_ref.training.settings import Rates as Rates

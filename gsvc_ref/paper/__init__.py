"""Profile `paper`: codes, quantisers, and exact reconstruction (spec.md sections 8, 10.5 and 10.6).

Values become codes and back by binary16 (`half`), LSQ+ (`lsq`) and residual vector quantisation (`rvq`). `reconstruct`
makes splats of a frame's codes and the splats of the frame before, bit for bit. Decoder and encoder share it: an
encoder that predicts from what it returns cannot drift from its decoders.
"""

from gsvc_ref.paper import lsq as lsq
from gsvc_ref.paper import lsq_parameters as lsq_parameters
from gsvc_ref.paper import rvq as rvq
from gsvc_ref.paper import rvq_training as rvq_training
from gsvc_ref.paper.codebook_update import RvqUpdate as RvqUpdate
from gsvc_ref.paper.codebook_update import rvq_update as rvq_update
from gsvc_ref.paper.codes import BlockKind as BlockKind
from gsvc_ref.paper.codes import Codebooks as Codebooks
from gsvc_ref.paper.codes import FrameCodes as FrameCodes
from gsvc_ref.paper.codes import FrameType as FrameType
from gsvc_ref.paper.codes import Quantizer as Quantizer
from gsvc_ref.paper.codes import SplatBlock as SplatBlock
from gsvc_ref.paper.half import coarsen_half as coarsen_half
from gsvc_ref.paper.half import from_half as from_half
from gsvc_ref.paper.half import half_is_finite as half_is_finite
from gsvc_ref.paper.half import to_half as to_half
from gsvc_ref.paper.lsq import lsq_dequantize as lsq_dequantize
from gsvc_ref.paper.lsq import lsq_gradients as lsq_gradients
from gsvc_ref.paper.lsq import lsq_quantize as lsq_quantize
from gsvc_ref.paper.lsq_parameters import LsqParameters as LsqParameters
from gsvc_ref.paper.reconstruct import Kept as Kept
from gsvc_ref.paper.reconstruct import State as State
from gsvc_ref.paper.reconstruct import reconstruct as reconstruct
from gsvc_ref.paper.reconstruct import reconstruct_inter as reconstruct_inter
from gsvc_ref.paper.reconstruct import reconstruct_intra as reconstruct_intra
from gsvc_ref.paper.rvq import Commitment as Commitment
from gsvc_ref.paper.rvq import commitment as commitment
from gsvc_ref.paper.rvq import rvq_assign as rvq_assign
from gsvc_ref.paper.rvq_training import RvqSettings as RvqSettings
from gsvc_ref.paper.rvq_training import RvqState as RvqState

"""What the package offers, by the module that each name comes from: type checkers read this, and so does `lazily`."""

from gsvc_base import spec as spec
from gsvc_base.errors import GsvcError as GsvcError
from gsvc_base.errors import UsageError as UsageError
from gsvc_base.splats import Splats as Splats
from gsvc_base.splats import scale_parameters as scale_parameters
from gsvc_base.splats import scale_parameters_filtered as scale_parameters_filtered
from gsvc_ref.bitstream.crc import parameter_checksum as parameter_checksum
from gsvc_ref.bitstream.planes import decode_plane as decode_plane
from gsvc_ref.bitstream.rans import encode_plane as encode_plane
from gsvc_ref.bitstream.work import rendering_work as rendering_work
from gsvc_ref.encoder import IncompleteEncodeError as IncompleteEncodeError
from gsvc_ref.encoder import Settings as Settings
from gsvc_ref.encoder import encode as encode
from gsvc_ref.encoder.key_frames import select_key_frames as select_key_frames
from gsvc_ref.main.operations import adapt_model as adapt_model
from gsvc_ref.main.operations import density_frequencies as density_frequencies
from gsvc_ref.main.operations import half_frequencies as half_frequencies
from gsvc_ref.main.operations import main_inter as main_inter
from gsvc_ref.main.operations import main_intra as main_intra
from gsvc_ref.main.operations import main_work as main_work
from gsvc_ref.main.operations import mode_contexts as mode_contexts
from gsvc_ref.main.operations import model_frequencies as model_frequencies
from gsvc_ref.main.operations import motion_of_splats as motion_of_splats
from gsvc_ref.main.operations import splat_classes as splat_classes
from gsvc_ref.main.operations import state_parameters as state_parameters
from gsvc_ref.main.operations import window_frequencies as window_frequencies
from gsvc_ref.main.passes import encode_run as encode_run
from gsvc_ref.paper import commitment as commitment
from gsvc_ref.paper import from_half as from_half
from gsvc_ref.paper import lsq_dequantize as lsq_dequantize
from gsvc_ref.paper import lsq_gradients as lsq_gradients
from gsvc_ref.paper import lsq_quantize as lsq_quantize
from gsvc_ref.paper import reconstruct_inter as reconstruct_inter
from gsvc_ref.paper import reconstruct_intra as reconstruct_intra
from gsvc_ref.paper import rvq_assign as rvq_assign
from gsvc_ref.paper import rvq_update as rvq_update
from gsvc_ref.paper import to_half as to_half
from gsvc_ref.rendering import exact_gradients_with_bound as exact_gradients_with_bound
from gsvc_ref.rendering import loss as loss
from gsvc_ref.rendering import render as render
from gsvc_ref.rendering import render_exact_with_bound as render_exact_with_bound
from gsvc_ref.rendering import render_frame as render_frame
from gsvc_ref.rendering import render_gradients as render_gradients
from gsvc_ref.rendering import render_sum as render_sum
from gsvc_ref.rendering import render_sum_deterministic as render_sum_deterministic
from gsvc_ref.rendering import to_frame as to_frame
from gsvc_ref.rendering import to_frame_deterministic as to_frame_deterministic
from gsvc_ref.stream import Gap as Gap
from gsvc_ref.stream import Stream
from gsvc_ref.stream import decode as decode
from gsvc_ref.stream import decode_layers as decode_layers
from gsvc_ref.stream import decode_stream as decode_stream
from gsvc_ref.stream import decode_stream_deterministic as decode_stream_deterministic
from gsvc_ref.stream import read_main_stream as read_main_stream
from gsvc_ref.stream import read_stream as read_stream
from gsvc_ref.stream import reconstruct_layers as reconstruct_layers
from gsvc_ref.stream import reconstruct_stream as reconstruct_stream
from gsvc_ref.stream import seek as seek
from gsvc_ref.training.augmentation import augment as augment
from gsvc_ref.training.operations import adan_step as adan_step
from gsvc_ref.training.operations import converged as converged
from gsvc_ref.training.operations import learning_rates as learning_rates
from gsvc_ref.training.pruning import compact as compact
from gsvc_ref.training.pruning import prune as prune
from gsvc_ref.training.pruning import pruning_plan as pruning_plan
from gsvc_ref.training.weighting import weighted_gradients as weighted_gradients
from gsvc_ref.training.weighting import weighted_parameters as weighted_parameters
from gsvc_ref.video.color import frame_to_planes as frame_to_planes
from gsvc_ref.video.color import planes_to_frame as planes_to_frame
from gsvc_tools.editing import concat as concat
from gsvc_tools.editing import cut as cut
from gsvc_tools.writing import write as write

open = Stream
__version__: str
__all__: list[str]

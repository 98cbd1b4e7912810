"""What the package offers, by the module that each name comes from: type checkers read this, and so does `lazily`."""

from gsvc_ref.stream.decoded import DecodedFrame as DecodedFrame
from gsvc_ref.stream.decoded import FrameSummary as FrameSummary
from gsvc_ref.stream.decoded import Gap as Gap
from gsvc_ref.stream.decoded import StreamSummary as StreamSummary
from gsvc_ref.stream.decoder import Stream as Stream
from gsvc_ref.stream.decoder import decode as decode
from gsvc_ref.stream.decoder import scaled_size as scaled_size
from gsvc_ref.stream.formats import video_format as video_format
from gsvc_ref.stream.reader import StreamReader as StreamReader
from gsvc_ref.stream.whole_streams import decode_layers as decode_layers
from gsvc_ref.stream.whole_streams import decode_stream as decode_stream
from gsvc_ref.stream.whole_streams import decode_stream_deterministic as decode_stream_deterministic
from gsvc_ref.stream.whole_streams import read_main_stream as read_main_stream
from gsvc_ref.stream.whole_streams import read_stream as read_stream
from gsvc_ref.stream.whole_streams import reconstruct_layers as reconstruct_layers
from gsvc_ref.stream.whole_streams import reconstruct_stream as reconstruct_stream
from gsvc_ref.stream.whole_streams import seek as seek
from gsvc_ref.stream.writer import StreamWriter as StreamWriter

__all__: list[str]

"""What the package offers, by the module that each name comes from: type checkers read this, and so does `lazily`."""

from gsvc_ref.video.color import to_planes as to_planes
from gsvc_ref.video.color import to_rgb as to_rgb
from gsvc_ref.video.format import ChromaFormat as ChromaFormat
from gsvc_ref.video.format import ColorDescription as ColorDescription
from gsvc_ref.video.format import Frame as Frame
from gsvc_ref.video.format import VideoFormat as VideoFormat
from gsvc_ref.video.opening import VideoSource as VideoSource
from gsvc_ref.video.opening import open_video as open_video
from gsvc_ref.video.opening import open_writer as open_writer
from gsvc_ref.video.png import decode_png as decode_png
from gsvc_ref.video.png import encode_png as encode_png
from gsvc_ref.video.stream import VideoReader as VideoReader
from gsvc_ref.video.stream import VideoWriter as VideoWriter

__all__: list[str]

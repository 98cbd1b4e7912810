"""What the package offers, by the module that each name comes from: type checkers read this, and so does `lazily`."""

from gsvc_ref.testing.assertions import assert_same_splats as assert_same_splats
from gsvc_ref.testing.assertions import assert_within_bound as assert_within_bound
from gsvc_ref.testing.examples import OVERVIEW_HEADER as OVERVIEW_HEADER
from gsvc_ref.testing.examples import RICH_HEADER as RICH_HEADER
from gsvc_ref.testing.examples import overview_frames as overview_frames
from gsvc_ref.testing.examples import rich_frames as rich_frames
from gsvc_ref.testing.faults import FaultyWriter as FaultyWriter
from gsvc_ref.testing.faults import Liar as Liar
from gsvc_ref.testing.faults import Lie as Lie
from gsvc_ref.testing.faults import join_chunks as join_chunks
from gsvc_ref.testing.faults import split_chunks as split_chunks
from gsvc_ref.testing.faults import write_stream as write_stream
from gsvc_ref.testing.frame_codes import frames as frames
from gsvc_ref.testing.frame_codes import headers as headers
from gsvc_ref.testing.frame_codes import main_streams as main_streams
from gsvc_ref.testing.frame_codes import streams as streams
from gsvc_ref.testing.random_main_streams import random_main_stream as random_main_stream
from gsvc_ref.testing.random_streams import Stream as Stream
from gsvc_ref.testing.random_streams import Wishes as Wishes
from gsvc_ref.testing.random_streams import random_stream as random_stream
from gsvc_ref.testing.strategies import Plane as Plane
from gsvc_ref.testing.strategies import planes as planes
from gsvc_ref.testing.strategies import splat_sets as splat_sets
from gsvc_ref.testing.strategies import videos as videos

__all__: list[str]

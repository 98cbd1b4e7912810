"""The encoder: a video in, a stream out, frame after frame.

In reading order: `loop` is all of it, the frames of a video in and encoded frames out; `setup` makes what it needs, and
`recording` writes what comes out of it, as a stream and a `report`. `frame_types` gives each frame its type, by the
rule of `key_frames` (DKS) after `pretraining`. `main` encodes the frames of profile `main`, `paper` those of profile
`paper`: its P-frames begin by `prediction`, and its preset `quick` fits by `quick`. `held_quality` searches numbers of
splats for a PSNR in both. `settings` and `effects` say what is asked for, `log` what was decided. `source_and_target`
opens both ends.
"""

from gsvc_ref.encoder.effects import Effects as Effects
from gsvc_ref.encoder.encode_video import encode as encode
from gsvc_ref.encoder.report import EncodeReport as EncodeReport
from gsvc_ref.encoder.report import FrameReport as FrameReport
from gsvc_ref.encoder.report import IncompleteEncodeError as IncompleteEncodeError
from gsvc_ref.encoder.report import Progress as Progress
from gsvc_ref.encoder.settings import Settings as Settings

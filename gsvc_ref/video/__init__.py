"""Video in and out: y4m, pictures, and through PyAV whatever FFmpeg knows; frames are always full-range R'G'B'."""

from gsvc_ref._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__)

"""Video in and out: y4m, pictures, and by plug-ins other files; frames are always full-range R'G'B'."""

from gsvc_ref._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__)

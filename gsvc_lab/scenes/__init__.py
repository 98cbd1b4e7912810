"""Synthetic clips of known content, drawn frame by frame, from a description that names what is to happen.

    from gsvc_lab.scenes import Scene, frames, truth

    scene = Scene.named("pan")                     # or Scene.from_toml("my.toml"), or Scene(...)
    for frame in frames(scene.resized(frames=10)):  # (H, W, 3) u1, each drawn when asked for
        ...
    truth(scene, 5)["motion"]                      # (2, H, W) f4, in pixels since frame 4
    gsvc_ref.encode(scene, "pan.gsvc")

What is not named is not imported: everything here is loaded on first use.
"""

from gsvc_ref._lazy import lazily

__getattr__, __dir__, __all__ = lazily(__name__)

"""The effects of scenes, a module each; `gsvc_ref.scenes.effect.effect_class` imports those that a scene names."""

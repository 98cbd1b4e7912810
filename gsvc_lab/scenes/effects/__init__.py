"""The effects of scenes, a module each; `gsvc_lab.scenes.effect.effect_class` imports those that a scene names."""

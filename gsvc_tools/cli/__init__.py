"""The commands of ``gsvc`` that gsvc_tools adds: ``view``, ``concat``, ``cut``, ``import`` and ``export``."""

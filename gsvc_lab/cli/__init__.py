"""The commands of ``gsvc`` that gsvc_lab adds: ``accuracy``, ``scene`` and ``demo``."""

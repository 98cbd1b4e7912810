"""The commands of ``gsvc`` that gsvc_lab adds: ``report``, ``accuracy``, ``scene`` and ``demo``."""

"""The commands of ``gsvc`` that gsvc_lab adds: ``report``, ``bench``, ``accuracy``, ``scene`` and ``demo``."""

"""The commands of ``gsvc`` that gsvc_tools adds."""

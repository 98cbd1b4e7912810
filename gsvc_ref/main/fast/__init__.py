"""The reading kernels of profile `main`: twins of its passes, compiled."""

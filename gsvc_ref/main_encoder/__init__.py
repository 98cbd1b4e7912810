"""The encoder of profile `main`: coordinates, I-frames, densities."""

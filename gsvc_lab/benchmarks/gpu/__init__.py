"""``python -m gsvc_lab.benchmarks.gpu``: judge and measure everything that runs on this machine's GPU, in minutes."""

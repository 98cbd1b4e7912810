"""The paper's experiments, each with its figure, its numbers beside the paper's claim, and a verdict."""

"""Measurements: the paper's experiments, the peers, the speed. Results go to docs/results."""

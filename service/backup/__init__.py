"""Copies of a data directory: made while the service runs, verified, restored."""

"""Rigid motions and fixed clouds: bounds, samples, nearest points, local planes."""

"""Connections of callers: accepted, counted, bounded in time, and closed."""

"""Registrations as data: rows, the transitions between their states, queries, retention."""

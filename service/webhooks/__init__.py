"""Callbacks at the end of registrations."""

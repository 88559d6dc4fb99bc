"""Version n is what `v<n>_<name>.py` makes of version n - 1. A released step is never edited."""

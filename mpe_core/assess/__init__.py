"""Assessment of a refined pose: how far to trust it, and which points correspond."""

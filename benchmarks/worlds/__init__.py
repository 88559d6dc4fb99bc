"""Generated worlds of many kinds and the scanners that look at them, with an exact truth."""

"""The HTTP interface: translates requests into calls of the runtime, and their results back."""

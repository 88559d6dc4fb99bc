"""Exit codes of the command line."""

EXIT_OK = 0
EXIT_ERROR = 1
"""An input is at fault, or the work failed."""
EXIT_USAGE = 2
"""The command line, the settings or the installation is at fault."""

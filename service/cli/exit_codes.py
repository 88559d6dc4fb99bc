"""Exit codes of the command line."""

EXIT_OK = 0
EXIT_ERROR = 1
"""An input is at fault, or the work failed."""
EXIT_USAGE = 2
"""The command line, the settings or the installation is at fault."""
EXIT_NOT_ACCEPTED = 3
"""The registration has ended, and its pose is not accepted."""
EXIT_SERVICE = 4
"""The service does not answer, refuses the request, or has failed."""

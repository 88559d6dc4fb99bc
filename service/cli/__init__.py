"""Command line: `mpe align` without a server, `mpe serve`, `mpe keys`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from service.cli.exit_codes import EXIT_USAGE


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line `mpe` and return its exit code."""
    try:
        from service.cli.commands import run_command
    except ModuleNotFoundError as error:  # only the dependencies of mpe_core are installed
        print(
            f"mpe: the command needs the Python package {error.name!r}, which is not installed; "
            "install all that it needs with: pip install 'mpe[service]'",
            file=sys.stderr,
        )
        return EXIT_USAGE
    return run_command(sys.argv[1:] if arguments is None else arguments)

"""Command line: `mpe align` without a server, `mpe serve`, `mpe keys`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from mpe_core import Registration, RegistrationError
from service.cli.align_arguments import (
    add_options,
    add_reading,
    numbers_as_such,
    options_of,
)
from service.cli.key_arguments import add_keys
from service.clouds.inputs import CLOUD_ROLES
from service.clouds.transform import transform_cloud
from service.formats import (
    WRITERS,
    CloudFileError,
    DecodedCloud,
    UnsupportedFileError,
    read_points,
    write_cloud,
)
from service.problems import NotReadyError
from service.schemas import Reading
from service.settings import Settings

WORKED, FAILED, MISUSED = 0, 1, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; 0 when it worked, 1 when an input is at fault, 2 when the call is."""
    words = sys.argv[1:] if arguments is None else arguments
    given = _parser().parse_args(numbers_as_such(words))
    return {"align": _align, "serve": _serve, "keys": _manage_keys}[given.command](given)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="mpe", description="Rigid registration of point clouds.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    align = commands.add_parser("align", help="align two files, without a server")
    align.add_argument("source", type=Path, help="the cloud that is moved")
    align.add_argument("target", type=Path, help="the cloud that stays")
    align.add_argument("--json", action="store_true", help="print the result as JSON")
    align.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help=f"write the moved source there; the ending says how: {', '.join(WRITERS)}",
    )
    add_reading(align)
    add_options(align)
    serve = commands.add_parser("serve", help="serve over HTTP; the settings are MPE_ variables")
    serve.add_argument("--host", default="127.0.0.1", help="address to listen on (%(default)s)")
    serve.add_argument("--port", default=8000, type=int, help="port to listen on (%(default)s)")
    add_keys(commands)
    return parser


def _align(given: argparse.Namespace) -> int:
    from mpe_core import register  # loads the kernels, which `mpe serve` must not

    try:
        options = options_of(given)
        ending = _ending(given.output)
        source, target = (_read(role, given) for role in CLOUD_ROLES)
        found = register(
            source.points,
            target.points,
            options,
            source_weights=source.weights,
            target_weights=target.weights,
        )
        if given.output:
            cloud = transform_cloud(source, found.T_target_source)
            write_cloud(given.output, ending, cloud.points, cloud.attributes)
    except (RegistrationError, CloudFileError) as error:
        return _complain(str(error), FAILED)
    except OSError as error:
        return _complain(f"{error.filename}: {error.strerror}", FAILED)
    for warning in (*source.warnings, *target.warnings, *found.warnings):
        print(f"mpe: warning: {warning}", file=sys.stderr)
    print(_document(found) if given.json else _summary(source, target, found))
    return WORKED


def _ending(output: Path | None) -> str:
    """Format to write; CloudFileError if no format has this ending."""
    ending = output.suffix.lower().lstrip(".") if output else "ply"
    if ending not in WRITERS:
        raise UnsupportedFileError(f"{output}: can be written as {', '.join(WRITERS)}")
    return ending


def _read(role: str, given: argparse.Namespace) -> DecodedCloud:
    path = getattr(given, role)
    reading = {name: getattr(given, f"{role}_{name}") for name in Reading.model_fields}
    try:
        return read_points(path, **reading, attributes=given.output is not None)
    except CloudFileError as error:
        raise type(error)(f"{path}: {error}") from error


def _document(found: Registration) -> str:
    from service.schemas.serialize_result import render_result

    return render_result(found).decode()


def _summary(source: DecodedCloud, target: DecodedCloud, found: Registration) -> str:
    from mpe_core.geometry.rigid import rotation_error

    T = found.T_target_source
    rows = "\n".join("  " + "".join(f"{value:>16.9g}" for value in row) for row in T)
    return f"""\
source      {len(source.points)} points ({source.format})
target      {len(target.points)} points ({target.format})
T_target_source
{rows}
rotation    {rotation_error(T, np.eye(4)):.4f} degrees
inliers     {len(found.inliers)} pairs closer than {found.inliers.threshold:.4g}
overlap     {100 * found.overlap:.1f} % of the source
rmse        {found.rmse:.4g} of the inliers
confidence  {found.confidence:.2f}
converged   {"yes" if found.converged else "no"}, {found.iterations} iterations
time        {found.timing["total"]:.2f} s"""


def _serve(given: argparse.Namespace) -> int:
    from service.auth.bind_check import UnprotectedBindError
    from service.server import serve  # loads the service, which `mpe align` does without

    if (wrong := _wrong_settings()) is not None:
        return _complain(wrong, MISUSED)
    try:
        serve(given.host, given.port)
    except UnprotectedBindError as error:
        return _complain(str(error), MISUSED)
    except NotReadyError as error:
        return _complain(str(error), FAILED)
    return WORKED


def _manage_keys(given: argparse.Namespace) -> int:
    from service.cli import keys as key_commands

    if (wrong := _wrong_settings()) is not None:
        return _complain(wrong, MISUSED)
    try:
        key_commands.run(given)
    except (ValueError, RuntimeError, OSError, NotReadyError) as error:
        return _complain(str(error), FAILED)
    return WORKED


def _wrong_settings() -> str | None:
    """What is wrong with the MPE_ variables."""
    try:
        Settings()
    except ValidationError as error:
        return "; ".join(
            f"{'MPE_' + str(item['loc'][0]).upper() + ': ' if item['loc'] else ''}{item['msg']}"
            for item in error.errors()
        )
    return None


def _complain(message: str, code: int) -> int:
    print(f"mpe: {message}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())

"""The commands of `mpe`: align, serve, keys, backup, restore, check, doctor."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mpe_core import Registration, RegistrationError
from service.cli.align_arguments import (
    add_options,
    add_read_options,
    parse_options,
    protect_negative_numbers,
)
from service.cli.backup import add_backup, back_up, check, restore
from service.cli.exit_codes import EXIT_ERROR, EXIT_OK, EXIT_USAGE
from service.cli.keys import add_keys, run
from service.clouds.aligned import write_aligned
from service.clouds.file_rows import in_file_rows
from service.clouds.inputs import CLOUD_ROLES
from service.formats import (
    WRITERS,
    CloudFileError,
    DecodedCloud,
    ReadLimits,
    UnsupportedFileError,
    read_crs,
    read_pieces,
    read_surface,
)
from service.formats.foreign import foreign_by_name
from service.problems import NotReadyError
from service.schemas import Reading
from service.settings import InvalidSettingsError, load_settings

_MEMORY_SHARE = 0.8
"""Share of the memory that `mpe align` may take; larger clouds are thinned while they are read."""


def run_command(arguments: Sequence[str]) -> int:
    """Parse the arguments, run the command and return its exit code."""
    parsed = _parser().parse_args(protect_negative_numbers(arguments))
    commands = {
        "align": _align,
        "serve": _serve,
        "keys": _keys,
        "backup": _copy,
        "restore": _copy,
        "check": _copy,
        "doctor": _doctor,
    }
    return commands[parsed.command](parsed)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="mpe", description="Rigid registration of point clouds.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    align = commands.add_parser("align", help="align two files, without a server")
    align.add_argument("source", type=Path, help="file of the cloud that is moved")
    align.add_argument("target", type=Path, help="file of the cloud that stays in place")
    align.add_argument("--json", action="store_true", help="print the result as JSON")
    align.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help=f"write the moved source to this file; its suffix selects the format: "
        f"{', '.join(WRITERS)}",
    )
    add_read_options(align)
    add_options(align)
    serve = commands.add_parser("serve", help="serve over HTTP; the settings are MPE_ variables")
    serve.add_argument("--host", default="127.0.0.1", help="address to listen on (%(default)s)")
    serve.add_argument("--port", default=8000, type=int, help="port to listen on (%(default)s)")
    add_keys(commands)
    add_backup(commands)
    commands.add_parser(
        "doctor", help="print cores, memory, parts of the sandbox, and whether workers start"
    )
    return parser


def _align(arguments: argparse.Namespace) -> int:
    from mpe_core import register  # loads the kernels, which `mpe serve` must not

    try:
        options = parse_options(arguments)
        output_format = _output_format(arguments.output)
        source, target = (_read(role, arguments) for role in CLOUD_ROLES)
        registration = register(
            source.points,
            target.points,
            options,
            source_weights=source.weights,
            target_weights=target.weights,
        )
        inliers = in_file_rows(registration.inliers, source, target)
        registration = replace(registration, inliers=inliers)
        written: tuple[str, ...] = ()
        if arguments.output:
            told = {*source.warnings, *target.warnings}
            written = tuple(
                text
                for text in write_aligned(
                    arguments.output,
                    output_format,
                    registration.T_target_source,
                    read_crs(arguments.target),
                    lambda: _pieces(source, arguments),
                )
                if text not in told
            )
    except (RegistrationError, CloudFileError) as error:
        return _fail(str(error), EXIT_ERROR)
    except OSError as error:
        return _fail(f"{error.filename}: {error.strerror}", EXIT_ERROR)
    for warning in (*source.warnings, *target.warnings, *registration.warnings, *written):
        print(f"mpe: warning: {warning}", file=sys.stderr)
    print(_document(registration) if arguments.json else _summary(source, target, registration))
    return EXIT_OK


def _output_format(output: Path | None) -> str:
    suffix = output.suffix.lower().lstrip(".") if output else "ply"
    if suffix not in WRITERS:
        raise UnsupportedFileError(
            f"{output}: expected a file name that ends in {', '.join(WRITERS)}"
        )
    return suffix


def _read(role: str, arguments: argparse.Namespace) -> DecodedCloud:
    path = getattr(arguments, role)
    reading = {name: getattr(arguments, f"{role}_{name}") for name in Reading.model_fields}
    try:
        return read_surface(path, _read_limits(), **reading, attributes=bool(arguments.output))
    except CloudFileError as error:
        named = foreign_by_name(path.name)
        raise type(error)(f"{path}: {error}{f'; {named}' if named else ''}") from error


def _pieces(source: DecodedCloud, arguments: argparse.Namespace) -> Iterator[DecodedCloud]:
    """Yield the source, the mesh where it was sampled; it is read again where it was thinned."""
    if source.rows is None:
        return iter([source.mesh or source])
    reading = {name: getattr(arguments, f"source_{name}") for name in Reading.model_fields}
    del reading["surface_samples"]
    return read_pieces(arguments.source, _read_limits(), **reading, attributes=True)


def _read_limits() -> ReadLimits:
    from mpe_core.machine import memory_limit

    return ReadLimits.within(int(_MEMORY_SHARE * memory_limit()))


def _document(registration: Registration) -> str:
    from service.schemas.serialize_result import render_result

    return render_result(registration).decode()


def _summary(source: DecodedCloud, target: DecodedCloud, registration: Registration) -> str:
    from mpe_core.geometry.rigid import rotation_error

    T = registration.T_target_source
    rows = "\n".join("  " + "".join(f"{value:>16.9g}" for value in row) for row in T)
    return f"""\
source      {len(source.points)} points ({source.format})
target      {len(target.points)} points ({target.format})
T_target_source
{rows}
rotation    {rotation_error(T[:3, :3] / registration.scale, np.eye(3)):.4f} degrees
scale       {registration.scale:.9g}
inliers     {len(registration.inliers)} pairs closer than {registration.inliers.threshold:.4g}
overlap     {100 * registration.overlap:.1f} % of the source
rmse        {registration.rmse:.4g} of the inliers
confidence  {registration.confidence:.2f}
converged   {"yes" if registration.converged else "no"}, {registration.iterations} iterations
time        {registration.timing["total"]:.2f} s"""


def _serve(arguments: argparse.Namespace) -> int:
    from service.auth.bind_check import UnprotectedBindError
    from service.database.store import StoreLostError
    from service.server import serve  # loads the service, which `mpe align` does without
    from service.workers.sandbox.confinement import SandboxError

    try:
        serve(load_settings(), arguments.host, arguments.port)
    except (InvalidSettingsError, UnprotectedBindError, SandboxError) as error:
        return _fail(str(error), EXIT_USAGE)
    except (NotReadyError, StoreLostError) as error:
        return _fail(str(error), EXIT_ERROR)
    return EXIT_OK


def _keys(arguments: argparse.Namespace) -> int:
    try:
        run(arguments, load_settings())
    except InvalidSettingsError as error:
        return _fail(str(error), EXIT_USAGE)
    except (ValueError, RuntimeError, OSError, NotReadyError) as error:
        return _fail(str(error), EXIT_ERROR)
    return EXIT_OK


def _copy(arguments: argparse.Namespace) -> int:
    actions = {"backup": back_up, "restore": restore, "check": check}
    try:
        is_whole = actions[arguments.command](arguments.directory, load_settings())
    except InvalidSettingsError as error:
        return _fail(str(error), EXIT_USAGE)
    except (ValueError, RuntimeError, OSError, NotReadyError) as error:
        return _fail(str(error), EXIT_ERROR)
    return EXIT_OK if is_whole else EXIT_ERROR


def _doctor(arguments: argparse.Namespace) -> int:
    from service.workers.sandbox.confinement import describe_sandbox, missing_parts
    from service.workers.start_check import find_start_failure

    print(_describe_machine())
    print(describe_sandbox())
    failure = find_start_failure()
    print(f"workers     {'start' if failure is None else 'do not start'}")
    faults = [f"this system lacks {part}" for part in missing_parts()]
    if failure is not None:
        faults.append(f"a worker does not start: {failure}")
    return _fail("; ".join(faults), EXIT_ERROR) if faults else EXIT_OK


def _describe_machine() -> str:
    from mpe_core.machine import available_cores, memory_left, memory_limit

    left = memory_left()
    text = f"cores       {available_cores()}\nmemory      {memory_limit() / 2**30:.1f} GiB"
    return text if left is None else f"{text}, of which {left / 2**30:.1f} GiB are left"


def _fail(message: str, code: int) -> int:
    print(f"mpe: {message}", file=sys.stderr)
    return code

"""`mpe align`: register two files without a server."""

from __future__ import annotations

import argparse
import hashlib
import sys
from collections.abc import Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpe_core import Registration, RegistrationError, RegistrationOptions
from service.cli.align_arguments import add_options, add_read_options, parse_options
from service.cli.exit_codes import EXIT_ERROR, EXIT_NOT_ACCEPTED, EXIT_OK
from service.cli.progress import show_progress
from service.clouds.aligned import Measure, write_aligned
from service.clouds.deviation import build_surface, move_points
from service.clouds.file_viewpoints import with_file_viewpoints
from service.clouds.inputs import CLOUD_ROLES
from service.clouds.register_files import register_files
from service.formats import (
    WRITERS,
    CloudFileError,
    DecodedCloud,
    ReadLimits,
    UnsupportedFileError,
    read_crs,
    read_pieces,
)
from service.formats.foreign_suffixes import foreign_by_name
from service.formats.surface import read_surface
from service.schemas import Reading

if TYPE_CHECKING:
    from mpe_core import MeshSurface, TargetSurface

_MEMORY_SHARE = 0.8
"""Share of the memory that `mpe align` may take; larger clouds are thinned while they are read."""


def add_align(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    align = commands.add_parser(
        "align",
        help="align two files, without a server",
        epilog="Exit codes: 0 the pose is accepted, 1 an input is at fault, 2 the command line is, "
        "3 the pose is not accepted.",
    )
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
    align.add_argument(
        "--distances",
        action="store_true",
        help="add the distance of each point from the target to the file of -o, as a scalar field",
    )
    align.add_argument("--report", type=Path, metavar="FILE", help="write a report (HTML)")
    align.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw both clouds before and after (PNG)"
    )
    align.add_argument("--unit", help="name of the unit of the files, for the report")
    align.add_argument(
        "--tolerance",
        type=float,
        action="append",
        default=[],
        metavar="LENGTH",
        help="distance for which the report tells the share of points within it; may be repeated",
    )
    add_read_options(align)
    add_options(align)


def run_align(arguments: argparse.Namespace) -> int:
    """Carry out `mpe align`; return its exit code."""
    try:
        return _align(arguments)
    except (RegistrationError, CloudFileError) as error:
        print(f"mpe: {error}", file=sys.stderr)
    except OSError as error:
        print(f"mpe: {error.filename}: {error.strerror}", file=sys.stderr)
    return EXIT_ERROR


def _align(arguments: argparse.Namespace) -> int:
    if arguments.distances and not arguments.output:
        raise UnsupportedFileError("--distances: expected -o FILE too, the file to write them to")
    options = parse_options(arguments)
    output_format = _output_format(arguments.output)
    source, target = (_read(role, arguments) for role in CLOUD_ROLES)
    options, places = with_file_viewpoints(options, source, target)
    with show_progress() as on_progress:
        registration = register_files(source, target, options, on_progress)
    written = _write(arguments, output_format, registration, options, source, target)
    if arguments.plot:
        _draw(arguments, registration, source, target)
    if arguments.report:
        _write_report(arguments, registration, options, source, target)
    read = *source.warnings, *target.warnings, *places
    for warning in (*read, *registration.warnings, *written):
        print(f"mpe: warning: {warning}", file=sys.stderr)
    print(_document(registration) if arguments.json else _summary(source, target, registration))
    return EXIT_OK if registration.accepted else EXIT_NOT_ACCEPTED


def _write(
    arguments: argparse.Namespace,
    format: str,
    registration: Registration,
    options: RegistrationOptions,
    source: DecodedCloud,
    target: DecodedCloud,
) -> tuple[str, ...]:
    """Write the moved source, if it is wanted; return the warnings that are new."""
    if not arguments.output:
        return ()
    measure: Measure | None = None
    if arguments.distances:
        measure = _build_surface(target, options).measure
    told = {*source.warnings, *target.warnings}
    warnings = write_aligned(
        arguments.output,
        format,
        registration.T_target_source,
        read_crs(arguments.target),
        lambda: _pieces(source, arguments),
        measure=measure,
    )
    return tuple(text for text in warnings if text not in told)


def _write_report(
    arguments: argparse.Namespace,
    registration: Registration,
    options: RegistrationOptions,
    source: DecodedCloud,
    target: DecodedCloud,
) -> None:
    """Write the report; files take the place of the clouds of a service."""
    import json

    from mpe_core import Deviation
    from service.workers.export_report import compose_report

    surface = _build_surface(target, options)
    moved = move_points(source.points, registration.T_target_source.tolist())
    job: dict[str, Any] = {
        "id": f"{arguments.source.name} on {arguments.target.name}",
        "labels": {},
        "source": _describe_file(arguments.source),
        "target": _describe_file(arguments.target),
        "options": asdict(options),
        "timing": {f"{stage}_s": seconds for stage, seconds in registration.timing.items()},
        "finished_at": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    page = compose_report(
        job,
        json.loads(_document(registration)),
        source.points.astype(np.float64),
        target.points.astype(np.float64),
        Deviation(surface.measure(moved), surface.is_signed),
        tolerances=arguments.tolerance,
        unit=arguments.unit,
        release=version("mpe"),
    )
    arguments.report.write_text(page, encoding="utf-8")


def _build_surface(
    target: DecodedCloud, options: RegistrationOptions
) -> TargetSurface | MeshSurface:
    ignores_file = options.ignore_file_viewpoints
    return build_surface(target, options.target_viewpoint, ignores_file=ignores_file)


def _draw(
    arguments: argparse.Namespace,
    registration: Registration,
    source: DecodedCloud,
    target: DecodedCloud,
) -> None:
    """Write the picture of both clouds before and after."""
    from service.report.pictures import draw_before_after

    moved = move_points(source.points, registration.T_target_source.tolist())
    before, fixed = source.points.astype(np.float64), target.points.astype(np.float64)
    arguments.plot.write_bytes(draw_before_after(before, moved, fixed))


def _describe_file(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {"cloud": path.name, "url": None, "size": path.stat().st_size, "sha256": digest}


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
        return read_surface(
            path, _read_limits(), **reading, attributes=bool(arguments.output or arguments.report)
        )
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

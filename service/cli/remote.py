"""Commands that call a running service: submit, watch, status, list, cancel, download."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict, fields
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpe_core import RegistrationError, RegistrationOptions
from service.cli.align_arguments import add_options, add_read_options, parse_options
from service.cli.exit_codes import (
    EXIT_ERROR,
    EXIT_NOT_ACCEPTED,
    EXIT_OK,
    EXIT_SERVICE,
    EXIT_USAGE,
)
from service.cli.progress import show_progress
from service.clouds.inputs import CLOUD_ROLES
from service.schemas import Reading

if TYPE_CHECKING:
    from mpe_client import Client, Job, JobSummary

REMOTE_COMMANDS = ("submit", "watch", "status", "list", "cancel", "download")
_STATUSES = ("queued", "running", "succeeded", "failed", "cancelled")
_EPILOG = (
    "Exit codes: 0 done, and the pose is accepted where the command waits for it; 1 an input is at "
    "fault, or the registration was cancelled; 2 the command line is at fault; 3 the pose is not "
    "accepted; 4 the service does not answer, refuses the request or has failed. The API key is "
    "read from MPE_CLIENT_KEY."
)
_ROW = "{:<38}{:<11}{:<21}{:<12}{}"


def add_remote(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the commands."""

    def add(name: str, help: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=f"{help}, by a service", epilog=_EPILOG)
        command.add_argument(
            "--url", help="address of the service (MPE_CLIENT_URL, else http://127.0.0.1:8000)"
        )
        command.add_argument("--json", action="store_true", help="print JSON")
        command.add_argument(
            "--patience",
            type=float,
            default=60.0,
            metavar="SECONDS",
            help="how long a service that does not answer is tried again (%(default)g)",
        )
        return command

    submit = add("submit", "align two clouds")
    for role in CLOUD_ROLES:
        submit.add_argument(role, help="path, URL, or cloud:ID for a stored cloud")
    submit.add_argument(
        "--wait", action="store_true", help="wait for the end, and print the result"
    )
    submit.add_argument("--label", action="append", default=[], metavar="NAME=VALUE")
    add_read_options(submit)
    add_options(submit)
    for name, text in (
        ("watch", "show the progress of a registration until it ends"),
        ("status", "print a registration"),
        ("cancel", "cancel a registration"),
    ):
        add(name, text).add_argument("id", help="id of the registration")
    listing = add("list", "list registrations, newest first")
    listing.add_argument("--status", choices=_STATUSES)
    listing.add_argument("--label", metavar="NAME:VALUE")
    listing.add_argument(
        "--search", metavar="WORDS", help="those with these words in labels, ids, URLs or hashes"
    )
    listing.add_argument("--limit", type=int, default=20, help="most rows (%(default)s)")
    _add_download(add("download", "fetch the moved source, the report or the picture"))


def _add_download(download: argparse.ArgumentParser) -> None:
    download.add_argument("id", help="id of the registration")
    download.add_argument(
        "file", type=Path, help="file to write: .html the report, .png the picture, else the cloud"
    )
    download.add_argument("--merged", action="store_true", help="append the target")
    download.add_argument("--distances", action="store_true", help="add distances, a scalar field")
    download.add_argument("--unit", help="name of the unit of the files, for the report")
    download.add_argument("--tolerance", type=float, action="append", default=[], metavar="LENGTH")


def run_remote(arguments: argparse.Namespace) -> int:
    """Carry out a command; return its exit code."""
    try:
        from mpe_client import Client, ClientError, Patience, ProblemError
    except ModuleNotFoundError as error:
        print(
            f"mpe: the command needs the Python package {error.name!r}; install it with: "
            "pip install 'mpe[client]'",
            file=sys.stderr,
        )
        return EXIT_USAGE
    run = _COMMANDS[arguments.command]
    try:
        patience = Patience(max_s=arguments.patience)
        with Client(arguments.url, patience=patience) as client:
            return run(client, arguments)
    except ProblemError as error:
        print(f"mpe: {error}", file=sys.stderr)
        return EXIT_ERROR if error.problem.status in (400, 404, 410, 413, 422) else EXIT_SERVICE
    except ClientError as error:
        print(f"mpe: {error}", file=sys.stderr)
        return EXIT_SERVICE
    except RegistrationError as error:
        print(f"mpe: {error}", file=sys.stderr)
    except OSError as error:
        print(f"mpe: {error.filename}: {error.strerror}", file=sys.stderr)
    return EXIT_ERROR


def _submit(client: Client, arguments: argparse.Namespace) -> int:
    from mpe_client import StoredCloud

    clouds = (
        StoredCloud(text.removeprefix("cloud:")) if text.startswith("cloud:") else text
        for text in (arguments.source, arguments.target)
    )
    source, target = clouds
    wanted: Any = _chosen_options(arguments) | {"reading": _readings(arguments)}
    wanted["labels"] = dict(item.split("=", 1) for item in arguments.label if "=" in item)
    job = client.submit(source, target, **wanted)
    if arguments.wait:
        return _wait(client, job.id, is_json=arguments.json)
    print(_render(job) if arguments.json else job.id)
    return EXIT_OK


def _chosen_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the options that differ from their defaults."""
    chosen, default = parse_options(arguments), RegistrationOptions()
    return {
        field.name: value
        for field in fields(chosen)
        if (value := getattr(chosen, field.name)) != getattr(default, field.name)
    }


def _readings(arguments: argparse.Namespace) -> dict[str, dict[str, Any]]:
    return {
        role: {
            name: value
            for name in Reading.model_fields
            if (value := getattr(arguments, f"{role}_{name}")) is not None
        }
        for role in CLOUD_ROLES
    }


def _watch(client: Client, arguments: argparse.Namespace) -> int:
    return _wait(client, arguments.id, is_json=arguments.json)


def _wait(client: Client, job_id: str, *, is_json: bool) -> int:
    with show_progress() as show:
        job = client.wait(
            job_id, on_progress=lambda progress: show(progress.stage, progress.fraction)
        )
    print(_render(job) if is_json else _describe(job))
    return _exit_code(job)


def _exit_code(job: Job) -> int:
    """Return the exit code for a registration that has ended."""
    if job.result is not None:
        return EXIT_OK if job.result.accepted else EXIT_NOT_ACCEPTED
    return EXIT_SERVICE if job.error is not None and job.error.status >= 500 else EXIT_ERROR


def _status(client: Client, arguments: argparse.Namespace) -> int:
    job = client.get(arguments.id)
    print(_render(job) if arguments.json else _describe(job))
    return EXIT_OK


def _list(client: Client, arguments: argparse.Namespace) -> int:
    names = ("status", "label", "search")
    filters: Any = {n: v for n in names if (v := getattr(arguments, n)) is not None}
    jobs = [job for job, _ in zip(client.list(**filters), range(arguments.limit), strict=False)]
    if arguments.json:
        print(json.dumps([_as_dict(job) for job in jobs]))
        return EXIT_OK
    print(_ROW.format("id", "status", "created (UTC)", "confidence", "labels"))
    for job in jobs:
        confidence = "" if job.confidence is None else f"{job.confidence:.2f}"
        labels = " ".join(f"{name}:{value}" for name, value in job.labels.items())
        print(
            _ROW.format(
                job.id, job.status, f"{job.created_at:%Y-%m-%d %H:%M:%S}", confidence, labels
            )
        )
    return EXIT_OK


def _cancel(client: Client, arguments: argparse.Namespace) -> int:
    job = client.cancel(arguments.id)
    print(_render(job) if arguments.json else f"{job.id} {job.status}")
    return EXIT_OK


def _download(client: Client, arguments: argparse.Namespace) -> int:
    path, suffix = arguments.file, arguments.file.suffix.lower()
    if suffix == ".html":
        client.download_report(
            arguments.id, path, unit=arguments.unit, tolerances=arguments.tolerance
        )
    elif suffix == ".png":
        client.download_picture(arguments.id, path)
    else:
        client.download_aligned(
            arguments.id, path, merged=arguments.merged, distances=arguments.distances
        )
    size = path.stat().st_size
    print(
        json.dumps({"file": str(path), "size": size}) if arguments.json else f"{path}: {size} bytes"
    )
    return EXIT_OK


def _describe(job: Job) -> str:
    """Return a registration for people."""
    lines = [f"{job.id} {job.status}"]
    if job.error is not None:
        lines.append(f"{job.error.title}: {job.error.detail}")
    if (result := job.result) is not None:
        lines += ["".join(f"{value:>16.9g}" for value in row) for row in result.transform]
        lines.append(f"overlap {100 * result.overlap:.1f} %, rmse {result.rmse:.4g}")
        accepted = "accepted" if result.accepted else "not accepted"
        lines.append(f"confidence {result.confidence:.2f}, {accepted}")
        lines += [f"warning: {warning.message}" for warning in result.warnings]
    elif not job.has_ended:
        lines.append(f"{job.progress.stage} {job.progress.fraction:.0%}")
    return "\n".join(lines)


def _render(job: Job) -> str:
    return json.dumps(_as_dict(job))


def _as_dict(job: JobSummary) -> dict[str, Any]:
    return {
        name: value.isoformat() if isinstance(value, datetime) else value
        for name, value in asdict(job).items()
    }


_COMMANDS: dict[str, Callable[[Client, argparse.Namespace], int]] = {
    "submit": _submit,
    "watch": _watch,
    "status": _status,
    "list": _list,
    "cancel": _cancel,
    "download": _download,
}

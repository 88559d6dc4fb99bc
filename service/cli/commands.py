"""The commands of `mpe`, put together."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Literal

from service.cli.admin import add_admin, run_admin
from service.cli.align import add_align, run_align
from service.cli.align_arguments import protect_negative_numbers
from service.cli.backup import add_backup, back_up, check, restore
from service.cli.completion import add_completion, render_completion
from service.cli.doctor import add_doctor, run_doctor
from service.cli.exit_codes import EXIT_ERROR, EXIT_OK, EXIT_USAGE
from service.cli.keys import add_keys, run
from service.cli.remote import REMOTE_COMMANDS, add_remote, run_remote
from service.problems import NotReadyError
from service.settings import InvalidSettingsError, load_settings


def run_command(arguments: Sequence[str]) -> int:
    """Parse the arguments, run the command and return its exit code."""
    parsed = _parser().parse_args(protect_negative_numbers(arguments))
    commands = {
        "align": run_align,
        "serve": _serve,
        "worker": _work,
        "keys": _keys,
        "admin": _administer,
        "backup": _copy,
        "restore": _copy,
        "check": _copy,
        "doctor": run_doctor,
        "completion": _completion,
        **dict.fromkeys(REMOTE_COMMANDS, run_remote),
    }
    return commands[parsed.command](parsed)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="mpe", description="Rigid registration of point clouds.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    add_align(commands)
    serve = commands.add_parser("serve", help="serve over HTTP; the settings are MPE_ variables")
    serve.add_argument("--host", default="127.0.0.1", help="address to listen on (%(default)s)")
    serve.add_argument("--port", default=8000, type=int, help="port to listen on (%(default)s)")
    serve.add_argument(
        "--no-workers", action="store_true", help="leave the registrations to `mpe worker`"
    )
    worker = commands.add_parser(
        "worker", help="run registrations of the database MPE_DATABASE_URL, and answer probes alone"
    )
    worker.add_argument("--host", default="127.0.0.1", help="address of the probes (%(default)s)")
    worker.add_argument("--port", default=8001, type=int, help="their port (%(default)s)")
    worker.add_argument(
        "--concurrency", type=int, metavar="N", help="registrations at once (MPE_WORKERS)"
    )
    worker.add_argument(
        "--labels",
        metavar="LABEL,...",
        help="labels of this worker, such as large (MPE_WORKER_LABELS)",
    )
    add_keys(commands)
    add_backup(commands)
    add_admin(commands)
    add_doctor(commands)
    add_remote(commands)
    add_completion(commands)
    return parser


def _serve(arguments: argparse.Namespace) -> int:
    return _run_service(arguments, "api" if arguments.no_workers else "all")


def _work(arguments: argparse.Namespace) -> int:
    given = {"workers": arguments.concurrency, "worker_labels": arguments.labels}
    return _run_service(
        arguments, "worker", **{name: value for name, value in given.items() if value is not None}
    )


def _run_service(
    arguments: argparse.Namespace, role: Literal["all", "api", "worker"], **given: object
) -> int:
    from service.auth.bind_check import UnprotectedBindError
    from service.database.store import StoreLostError
    from service.server import serve  # loads the service, which `mpe align` does without
    from service.workers.sandbox.confinement import SandboxError

    try:
        settings = load_settings(**given)
        if role != "all":
            settings.check_shared()
        serve(settings, arguments.host, arguments.port, role)
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


def _administer(arguments: argparse.Namespace) -> int:
    try:
        is_whole = run_admin(arguments, load_settings())
    except InvalidSettingsError as error:
        return _fail(str(error), EXIT_USAGE)
    except (RuntimeError, OSError, NotReadyError) as error:
        return _fail(str(error), EXIT_ERROR)
    return EXIT_OK if is_whole else EXIT_ERROR


def _completion(arguments: argparse.Namespace) -> int:
    print(render_completion(_parser(), arguments.shell))
    return EXIT_OK


def _fail(message: str, code: int) -> int:
    print(f"mpe: {message}", file=sys.stderr)
    return code

"""Arguments of `mpe align`: one for each field of a reading and each option of a registration."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, get_args, get_type_hints

from mpe_core import RegistrationOptions
from mpe_core.options import Matrix, Vector
from service.cli.pose_file import read_pose
from service.clouds.inputs import CLOUD_ROLES
from service.schemas import Reading, describe_options
from service.schemas.options import OPTION_NAMES

_SMALL = re.compile(r"-\d*\.?\d*[eE][+-]?\d+")
FILE = "FILE holds four lines of four numbers, or JSON with them as `transform`. "
HINTS = get_type_hints(RegistrationOptions)


def numbers_as_such(words: Iterable[str]) -> list[str]:
    """argparse takes -1e-5 for an option, before Python 3.14; a blank tells that it is none."""
    return [f" {word}" if _SMALL.fullmatch(word) else word for word in words]


def add_reading(parser: argparse.ArgumentParser) -> None:
    """--source-format and the like: one for each cloud and each field of a reading."""
    group = parser.add_argument_group("reading of the files")
    for role in CLOUD_ROLES:
        for name, field in Reading.model_fields.items():
            kind = int if int in get_args(field.annotation) else str
            group.add_argument(
                f"--{role}-{name.replace('_', '-')}",
                type=kind,
                metavar=kind.__name__.upper(),
                help=field.description,
            )


def add_options(parser: argparse.ArgumentParser) -> None:
    """One --option for each option of a registration, with its own description and default."""
    group = parser.add_argument_group("options of the registration")
    for name, schema in describe_options().items():
        form = _form(HINTS[name])
        file = FILE if form.get("metavar") == "FILE" else ""
        default = schema["default"]
        description = f"{schema['description']} {file}Default: {default}.".replace("%", "%%")
        group.add_argument(
            f"--{name.replace('_', '-')}",
            dest=name,
            default=default,
            help=description,
            **form,
        )


def _form(hint: Any) -> dict[str, Any]:
    """How an option of this type is written."""
    if hint is bool:
        return {"action": "store_true"}
    if hint == Vector | None:
        return {"type": float, "nargs": 3, "metavar": ("X", "Y", "Z")}
    if hint == Matrix | None:
        return {"type": Path, "metavar": "FILE"}
    kinds = get_args(hint) or (hint,)
    if all(isinstance(kind, str) for kind in kinds):
        return {"type": str, "choices": kinds}
    return {"type": kinds[0], "metavar": kinds[0].__name__.upper()}


def options_of(given: argparse.Namespace) -> RegistrationOptions:
    """The options that were given, files of poses read.

    Raises
    ------
    InvalidOptionsError
        An option is out of its range, or a file is no pose.
    OSError
        A file cannot be read.
    """
    values = {name: getattr(given, name) for name in OPTION_NAMES}
    return RegistrationOptions(
        **{name: read_pose(v) if isinstance(v, Path) else v for name, v in values.items()}
    )

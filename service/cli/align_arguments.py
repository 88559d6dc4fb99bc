"""Arguments of `mpe align`, made from the fields of `Reading` and `RegistrationOptions`."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, get_args, get_type_hints

from mpe_core import RegistrationOptions
from mpe_core.options import Matrix, Scale, Vector, Viewpoints
from service.cli.pose_file import read_pose
from service.clouds.inputs import CLOUD_ROLES
from service.schemas import Reading, describe_options
from service.schemas.options import OPTION_NAMES

_EXPONENT_NUMBER = re.compile(r"-\d*\.?\d*[eE][+-]?\d+")
FILE_HELP = "FILE holds four lines of four numbers, or JSON with them as `transform`. "
REPEATED_HELP = "May be repeated. "
XYZ: dict[str, Any] = {"type": float, "nargs": 3, "metavar": ("X", "Y", "Z")}
HINTS = get_type_hints(RegistrationOptions)


def protect_negative_numbers(words: Iterable[str]) -> list[str]:
    """Put a blank before words like -1e-5, which argparse takes for options before Python 3.14."""
    return [f" {word}" if _EXPONENT_NUMBER.fullmatch(word) else word for word in words]


def add_read_options(parser: argparse.ArgumentParser) -> None:
    """Add --source-format and the like: one for each cloud and each field of `Reading`."""
    group = parser.add_argument_group("how the files are read")
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
    """Add one --option for each option of a registration, with its description and default."""
    group = parser.add_argument_group("options of the registration")
    for name, schema in describe_options().items():
        form = _argument_form(HINTS[name])
        note = FILE_HELP if form.get("metavar") == "FILE" else ""
        note = REPEATED_HELP if form.get("action") == "append" else note
        default = schema["default"]
        description = f"{schema['description']} {note}Default: {default}.".replace("%", "%%")
        group.add_argument(
            f"--{name.replace('_', '-')}",
            dest=name,
            default=default,
            help=description,
            **form,
        )


def _argument_form(hint: Any) -> dict[str, Any]:
    """Return the keywords of `add_argument` for an option of this type."""
    if hint is bool:
        return {"action": "store_true"}
    if hint == Vector | None:
        return XYZ
    if hint == Viewpoints | None:
        return XYZ | {"action": "append"}
    if hint == Matrix | None:
        return {"type": Path, "metavar": "FILE"}
    if hint == Scale:
        return {"type": _scale, "metavar": "fixed|units|free|LEAST,MOST"}
    kinds = get_args(hint) or (hint,)
    if all(isinstance(kind, str) for kind in kinds):
        return {"type": str, "choices": kinds}
    return {"type": kinds[0], "metavar": kinds[0].__name__.upper()}


def _scale(word: str) -> str | tuple[float, ...]:
    return tuple(map(float, word.split(","))) if "," in word else word


def parse_options(arguments: argparse.Namespace) -> RegistrationOptions:
    """Build the options from parsed arguments; poses are read from their files.

    Raises
    ------
    InvalidOptionsError
        An option is out of its range, or a file holds no pose.
    OSError
        A file cannot be read.
    """
    values = {name: getattr(arguments, name) for name in OPTION_NAMES}
    return RegistrationOptions(
        **{name: read_pose(v) if isinstance(v, Path) else v for name, v in values.items()}
    )

"""Hashes that tell whether two requests, or the work of two jobs, are the same."""

from __future__ import annotations

import functools
import hashlib
import json
from importlib.metadata import version
from typing import Any

from service.clouds.inputs import CloudInput


def hash_work(source: CloudInput, target: CloudInput, options: dict[str, Any]) -> str | None:
    """Hash the clouds' content, the options and the release; None before both clouds are stored."""
    if source.sha256 is None or target.sha256 is None:
        return None
    return hash_json(
        [source.sha256, source.reading, target.sha256, target.reading, options, _release()]
    )


def hash_json(content: Any) -> str:
    """Hash a JSON value; the order of keys does not matter."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@functools.cache
def _release() -> str:
    return version("mpe")  # reads a file, which takes 1 ms

"""What schemathesis cannot guess: files that are point clouds, and keys used once."""

from __future__ import annotations

from typing import Any
from uuid import uuid4

import schemathesis
from hypothesis import strategies as st

from tests.factories.cloud_files import seeds
from tests.factories.scanner_files import scanner_seeds

CLOUDS = st.sampled_from([file for _, file in sorted((seeds() | scanner_seeds()).items())])
KNOWLEDGE = (
    "initial_transform",
    "source_gravity",
    "target_gravity",
    "source_viewpoint",
    "target_viewpoint",
    "yaw_only",
    "voxel_size",
    "max_rotation_deg",
    "max_translation",
    "scale",
)
"""Options that have to fit one another and the method, or whose numbers have an order, which the
description only says in words."""

schemathesis.openapi.format("binary", CLOUDS)
schemathesis.openapi.media_type("application/octet-stream", CLOUDS)
schemathesis.openapi.media_type("application/offset+octet-stream", st.binary(max_size=100))


@schemathesis.hook
def before_call(_: Any, case: schemathesis.Case, __: dict[str, Any]) -> None:
    """Another request under the key of a former one is refused, and that is right."""
    key, once = (case.headers or {}).get("idempotency-key"), str(uuid4())
    if key and isinstance(key, str):  # one that is too long stays so
        case.headers["idempotency-key"] = key[: -len(once)] + once


@schemathesis.hook
def before_load_schema(_: Any, description: dict[str, Any]) -> None:
    """Requests are made without these options."""
    for name in KNOWLEDGE:
        del description["components"]["schemas"]["RegistrationOptions"]["properties"][name]

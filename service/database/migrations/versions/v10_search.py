"""The names that a search for jobs looks at."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from alembic import op
from sqlalchemy import JSON, Column, Row, String, bindparam, column, select, table, update

revision = "10"
down_revision = "9"

ROWS = 1000
"""Rows that are changed at once."""
_jobs = table(
    "jobs",
    column("id", String),
    column("labels", JSON),
    column("source", JSON),
    column("target", JSON),
    column("search_text", String),
)


def upgrade() -> None:
    """From version 9 to version 10."""
    op.add_column("jobs", Column("search_text", String, nullable=False, server_default=""))
    connection = op.get_bind()
    fill = update(_jobs).where(_jobs.c.id == bindparam("job")).values(search_text=bindparam("text"))
    last = ""
    while rows := connection.execute(
        select(_jobs).where(_jobs.c.id > last).order_by(_jobs.c.id).limit(ROWS)
    ).all():
        connection.execute(fill, [{"job": row.id, "text": _render(row)} for row in rows])
        last = rows[-1].id


def _render(row: Row[Any]) -> str:
    text = "\n".join(name for name in _names(row) if name)
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text).casefold())


def _names(row: Row[Any]) -> Iterator[str | None]:
    yield from row.labels.values()
    for cloud in (row.source, row.target):
        yield cloud["cloud"]
        if cloud["url"]:
            parts = urlsplit(cloud["url"])
            host = parts.netloc.rpartition("@")[2]
            yield urlunsplit((parts.scheme, host, parts.path, "", ""))

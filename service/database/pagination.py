"""Keyset pagination: pages of rows, newest first, each beginning where the last one ended."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeVar

from sqlalchemy import Select, Table, select, tuple_

Place = tuple[float, str]
"""created_at and id of a row: where a page ends."""

CURSOR = r"^[0-9]{1,12}\.[0-9]{9}_[A-Za-z0-9._-]{1,64}$"
"""Pattern of a cursor."""


class Paged(Protocol):
    """A row that has a place in its list."""

    @property
    def created_at(self) -> float:
        """Seconds since the epoch."""

    @property
    def id(self) -> str:
        """Breaks ties between rows made at the same time."""


def select_page(table: Table, *, before: Place | None, limit: int) -> Select[Any]:
    """Select up to `limit` rows of the table, newest first, after the place `before`."""
    created, key = table.c.created_at, table.c.id
    query = select(table).order_by(created.desc(), key.desc()).limit(limit)
    if before is None:
        return query
    return query.where(tuple_(created, key) < before)  # as one comparison an index serves it


RowT = TypeVar("RowT", bound=Paged)


def cut_page(rows: Sequence[RowT], limit: int) -> tuple[Sequence[RowT], str | None]:
    """Return the first `limit` rows, and the cursor of the next page if there are more rows."""
    has_more = len(rows) > limit
    return rows[:limit], encode_cursor(rows[limit - 1]) if has_more else None


def encode_cursor(item: Paged) -> str:
    """Return the cursor of the item's place; it matches CURSOR."""
    return f"{item.created_at:.9f}_{item.id}"


def decode_cursor(cursor: str) -> Place:
    """Return the place that a cursor names."""
    created_at, _, item_id = cursor.partition("_")
    return float(created_at), item_id

"""Which jobs a list shows, and in which order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Select

from service.database.pagination import Place, select_page
from service.database.tables import jobs


@dataclass(frozen=True, slots=True)
class Filter:
    """Which jobs a list shows; None: all of the tenant."""

    tenant: str
    status: str | None = None
    label: tuple[str, str] | None = None
    created_after: float | None = None
    created_before: float | None = None


def newest_first(only: Filter, *, before: Place | None, limit: int) -> Select[Any]:
    """The query for a page of jobs."""
    return select_page(jobs, before=before, limit=limit).where(*_conditions(only))


def _conditions(only: Filter) -> list[ColumnElement[bool]]:
    conditions = [jobs.c.tenant == only.tenant]
    if only.status is not None:
        conditions.append(jobs.c.status == only.status)
    if only.label is not None:
        name, value = only.label
        conditions.append(jobs.c.labels[name].as_string() == value)
    if only.created_after is not None:
        conditions.append(jobs.c.created_at > only.created_after)
    if only.created_before is not None:
        conditions.append(jobs.c.created_at < only.created_before)
    return conditions

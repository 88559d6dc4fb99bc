"""Which queued job runs next: tenants take turns, and priority orders the jobs of one tenant.

The tenant with the fewest running jobs is next; among equals the one that was served least
recently. A job is claimed in an exclusive transaction, so that two claims never count the same
running jobs.
"""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Float,
    Row,
    Select,
    and_,
    bindparam,
    func,
    insert,
    or_,
    select,
    update,
)
from sqlalchemy.sql.dml import ReturningUpdate

from service.database.tables import jobs, turns

MAX_PAUSE_S = 600.0
"""Maximum pause, in seconds, of a job whose attempt was interrupted; a longer one is a clock that
was set back."""


def claim_next(connection: Connection, *, lease_s: float) -> Row[Any] | None:
    """Begin an attempt at the next job; return its row, or None when none can be claimed.

    Call it within an exclusive transaction.
    """
    now = time.time()
    tenant = connection.scalar(_NEXT_TENANT, {"now": now})
    if tenant is None:
        return None
    values = {"claimed_tenant": tenant, "now": now}
    times = {"started_at": now, "lease_until": now + lease_s}
    row = connection.execute(_CLAIM, values | times).one_or_none()
    if row is not None:
        _record_turn(connection, tenant)
    return row


def _record_turn(connection: Connection, tenant: str) -> None:
    """Make the tenant the most recently served one; turns are counted, not timed."""
    turn = (connection.scalar(select(func.max(turns.c.turn))) or 0) + 1
    is_known = connection.execute(
        update(turns).where(turns.c.tenant == tenant).values(turn=turn)
    ).rowcount
    if not is_known:
        connection.execute(insert(turns).values(tenant=tenant, turn=turn))


def _is_claimable() -> ColumnElement[bool]:
    now = bindparam("now", type_=Float)
    is_paused = and_(jobs.c.paused_until > now, jobs.c.paused_until <= now + MAX_PAUSE_S)
    return and_(jobs.c.status == "queued", or_(jobs.c.paused_until.is_(None), ~is_paused))


def _select_next_tenant() -> Select[Any]:
    waiting = select(jobs.c.tenant).where(_is_claimable()).distinct().subquery()
    running = (
        select(jobs.c.tenant, func.count().label("number"))
        .where(jobs.c.status == "running")
        .group_by(jobs.c.tenant)
        .subquery()
    )
    return (
        select(waiting.c.tenant)
        .outerjoin(running, running.c.tenant == waiting.c.tenant)
        .outerjoin(turns, turns.c.tenant == waiting.c.tenant)
        .order_by(
            func.coalesce(running.c.number, 0), func.coalesce(turns.c.turn, 0), waiting.c.tenant
        )
        .limit(1)
    )


def _claim_first_of_tenant() -> ReturningUpdate[Any]:
    first = (
        select(jobs.c.id)
        .where(_is_claimable(), jobs.c.tenant == bindparam("claimed_tenant"))
        .order_by(jobs.c.priority.desc(), jobs.c.created_at, jobs.c.id)
        .limit(1)
        .with_for_update(skip_locked=True)
        .scalar_subquery()
    )
    claim = update(jobs).where(jobs.c.id == first, jobs.c.status == "queued")
    return claim.values(
        status="running",
        attempt=jobs.c.attempt + 1,
        started_at=bindparam("started_at"),
        lease_until=bindparam("lease_until"),
    ).returning(jobs)


_NEXT_TENANT = _select_next_tenant()  # built once: building takes as long as executing
_CLAIM = _claim_first_of_tenant()

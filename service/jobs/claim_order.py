"""Which job of a queue is next: tenants take turns, and priority orders the jobs of one tenant.

The tenant with the fewest running jobs of the queue is next; among equals the one that was served
least recently. A job is claimed in an exclusive transaction, so that two claims never count the
same running jobs.
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Float,
    Integer,
    Row,
    Select,
    String,
    and_,
    bindparam,
    exists,
    func,
    insert,
    or_,
    select,
    update,
)
from sqlalchemy.sql.dml import ReturningUpdate

from service.database.clock import now
from service.database.tables import jobs, turns
from service.jobs.model import JobQueue

MAX_PAUSE_S = 600.0
"""Maximum pause, in seconds, of a job whose attempt was interrupted; a longer one is a clock that
was set back."""
NO_LIMIT = 2**31 - 1
"""More jobs of a tenant than can run."""


def find_next_tenant(connection: Connection, queue: JobQueue, tenant_limit: int) -> str | None:
    """Return the tenant whose job of the queue is next; None when none can be claimed.

    Parameters
    ----------
    tenant_limit
        Jobs of the queue that a tenant may have running, the next one included.
    """
    values = {"claimed_queue": queue, "tenant_limit": tenant_limit}
    tenant: str | None = connection.scalar(_NEXT_TENANT, values)
    return tenant


def claim_next(
    connection: Connection, queue: JobQueue, tenant_limit: int, *, lease_s: float
) -> Row[Any] | None:
    """Begin an attempt at the next job; return its row, or None when none can be claimed.

    Call it within an exclusive transaction.

    See Also
    --------
    find_next_tenant : says whose it is.
    """
    tenant = find_next_tenant(connection, queue, tenant_limit)
    if tenant is None:
        return None
    values = {"claimed_tenant": tenant, "claimed_queue": queue, "lease_s": lease_s}
    row = connection.execute(_CLAIM, values).one_or_none()
    if row is not None:
        record_turn(connection, tenant, queue)
    return row


def record_turn(connection: Connection, tenant: str, queue: str) -> None:
    """Make the tenant the most recently served one of the queue; turns are counted, not timed."""
    last = turns.alias()
    highest = select(func.coalesce(func.max(last.c.turn), 0)).where(last.c.queue == queue)
    turn = highest.scalar_subquery() + 1
    own = and_(turns.c.tenant == tenant, turns.c.queue == queue)
    if not connection.execute(update(turns).where(own).values(turn=turn)).rowcount:
        connection.execute(insert(turns).values(tenant=tenant, queue=queue, turn=turn))


def enter_queue(connection: Connection, tenant: str, *queues: JobQueue) -> None:
    """Let the tenant take turns in the queues, before its first job there; it goes first."""
    query = select(turns.c.queue).where(turns.c.tenant == tenant)
    for queue in set(queues) - set(connection.scalars(query)):
        connection.execute(insert(turns).values(tenant=tenant, queue=queue, turn=0))


def _is_claimable() -> ColumnElement[bool]:
    is_paused = and_(jobs.c.paused_until > now(), jobs.c.paused_until <= now() + MAX_PAUSE_S)
    is_free = or_(jobs.c.paused_until.is_(None), ~is_paused)
    return and_(jobs.c.status == "queued", jobs.c.queue == _QUEUE, is_free)


def _select_next_tenant() -> Select[Any]:
    running = (
        select(jobs.c.tenant, func.count().label("number"))
        .where(jobs.c.status == "running", jobs.c.queue == _QUEUE)
        .group_by(jobs.c.tenant)
        .subquery()
    )
    number = func.coalesce(running.c.number, 0)
    # a look for each tenant, not at each job that waits
    is_waiting = exists().where(_is_claimable(), jobs.c.tenant == turns.c.tenant)
    return (
        select(turns.c.tenant)
        .outerjoin(running, running.c.tenant == turns.c.tenant)
        .where(turns.c.queue == _QUEUE, is_waiting)
        .where(number < bindparam("tenant_limit", type_=Integer))
        .order_by(number, turns.c.turn, turns.c.tenant)
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
        started_at=now(),
        lease_until=now() + bindparam("lease_s", type_=Float),
    ).returning(jobs)


_QUEUE = bindparam("claimed_queue", type_=String)
_NEXT_TENANT = _select_next_tenant()  # built once: building takes as long as executing
_CLAIM = _claim_first_of_tenant()

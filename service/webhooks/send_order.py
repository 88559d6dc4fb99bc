"""Which callback is sent next: tenants take turns, and the hosts of a tenant do.

The tenant with the fewest calls under way is next, among equals the one that was served least
recently; of its hosts the one with the fewest calls under way, then the one that has waited
longest. A tenant gets no more senders than it leaves free, and a host no more than it leaves of
those: one that does not answer delays no other.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, Connection, Row, and_, func, select

from service.database.clock import now
from service.database.tables import deliveries, turns

QUEUE = "callback"
"""Name of the turns of callbacks, beside those of the queues of jobs."""


class Place(NamedTuple):
    """Whose callback, and to which host and port."""

    tenant: str
    host: str


def is_due() -> ColumnElement[bool]:
    """Return the condition of a delivery to send now; one of a killed sender is due again."""
    unfinished = deliveries.c.status.in_(("pending", "sending"))
    return and_(unfinished, deliveries.c.next_at <= now())


def find_next(connection: Connection, free: int) -> Row[Any] | None:
    """Return the row of the delivery that is next; None when none may be sent now.

    Parameters
    ----------
    free
        Senders without a call, the one that asks included.
    """
    place = _find_next_place(connection, free)
    if place is None:
        return None
    of_place = and_(deliveries.c.tenant == place.tenant, deliveries.c.host == place.host)
    query = select(deliveries).where(of_place, is_due()).order_by(deliveries.c.next_at).limit(1)
    return connection.execute(query).one_or_none()


def _find_next_place(connection: Connection, free: int) -> Place | None:
    columns = (deliveries.c.tenant, deliveries.c.host)
    waiting = select(*columns, func.min(deliveries.c.next_at)).where(is_due()).group_by(*columns)
    due = {Place(tenant, host): since for tenant, host, since in connection.execute(waiting)}
    if not due:
        return None
    by_host = _count_under_way(connection)
    by_tenant: Counter[str] = Counter()
    for place, number in by_host.items():
        by_tenant[place.tenant] += number
    last = _last_turns(connection)

    def may_send(place: Place) -> bool:
        left = free - by_tenant[place.tenant]
        return by_host[place] < left

    def rank(place: Place) -> tuple[int, int, str, int, float]:
        tenant = place.tenant
        return by_tenant[tenant], last.get(tenant, 0), tenant, by_host[place], due[place]

    return min(filter(may_send, due), key=rank, default=None)


def _count_under_way(connection: Connection) -> Counter[Place]:
    columns = (deliveries.c.tenant, deliveries.c.host)
    sending = and_(deliveries.c.status == "sending", deliveries.c.next_at > now())
    rows = connection.execute(select(*columns, func.count()).where(sending).group_by(*columns))
    return Counter({Place(tenant, host): number for tenant, host, number in rows})


def _last_turns(connection: Connection) -> dict[str, int]:
    rows = connection.execute(select(turns.c.tenant, turns.c.turn).where(turns.c.queue == QUEUE))
    return {row.tenant: row.turn for row in rows}

"""Which part of a cluster is full first, from the costs of one registration."""

from __future__ import annotations

from benchmarks.experiment import Result, markdown

WORKERS = (10, 100, 1000)
WORKERS_PER_SERVICE = 4
CONNECTIONS_PER_SERVICE = 5
"""Of a service with four workers: one that listens, and one for each worker at work."""
DATABASE_CORES, STORE_CORES = 4, 4
SERVER_CONNECTIONS = 100
"""What PostgreSQL allows by default (`max_connections`)."""


def describe_model(result: Result) -> str:
    """Return what is full first for each number of workers and each size of clouds."""
    rows = [
        _row(result, workers, points, each["running_s"] + each["overhead_s"])
        for points, each in result["registrations"].items()
        for workers in WORKERS
    ]
    heads = (
        *("points", "workers", "demand 1/s", "claims 1/s", "database 1/s", "store 1/s"),
        *("connections", "first bottleneck", "left of the demand"),
    )
    return (
        "`demand` is what the workers would do alone. `claims` is the most that the simulation "
        "reached on this machine, where claims are one transaction after the other. `database` "
        f"and `store` are {DATABASE_CORES} and {STORE_CORES} cores divided by the cost of a "
        "registration and of the looks of its attempt. `connections` are those of services with "
        f"{WORKERS_PER_SERVICE} workers each; PostgreSQL allows {SERVER_CONNECTIONS} unless "
        "`max_connections` is set.\n\n" + markdown(heads, rows)
    )


def _row(result: Result, workers: int, points: str, seconds: float) -> tuple[object, ...]:
    demand = workers / seconds
    claims = max(run["per_s"] for run in result["runs"])
    costs_ms = _costs_ms(result, seconds)
    rates = {
        "claims": claims,
        "database": 1000 * DATABASE_CORES / costs_ms["database"],
        "store": 1000 * STORE_CORES / costs_ms["store"],
    }
    lowest = min(rates, key=lambda name: rates[name])
    connections = workers // WORKERS_PER_SERVICE * CONNECTIONS_PER_SERVICE
    first = "the workers' cores" if rates[lowest] >= demand else lowest
    if connections > SERVER_CONNECTIONS:
        first += "; max_connections"
    share = min(1.0, rates[lowest] / demand)
    return (points, workers, demand, *rates.values(), connections, first, f"{100 * share:.0f} %")


def _costs_ms(result: Result, seconds: float) -> dict[str, float]:
    """Return the core milliseconds of one registration; those of the database grow with its time.

    A line through two runs with as many workers: the one whose sleeps are short, and the long one.
    """
    short, long = result["runs"][-2:]
    name = "database, ms of a core"
    slope = (long["per_job"][name] - short["per_job"][name]) / (long["sleep_s"] - short["sleep_s"])
    database = short["per_job"][name] + max(0.0, slope) * max(0.0, seconds - short["sleep_s"])
    return {"database": database, "store": short["per_job"]["store, ms of a core"]}

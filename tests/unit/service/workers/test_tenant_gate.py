"""Costly calls take turns without threads, fairly and within bounds."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from service.problems import OverloadedError, QuotaExceededError
from service.workers.tenant_gate import MAX_WAITING, MAX_WAITING_PER_TENANT, TenantGate

MAX_RUNNING = 2


def on_full_gate(use: Callable[[TenantGate], Awaitable[None]]) -> None:
    """Run a coroutine with a gate that tenant `a` has filled."""

    async def run() -> None:
        gate = TenantGate(MAX_RUNNING, "exports")
        for _ in range(MAX_RUNNING):
            await gate.acquire("a")
        await use(gate)

    asyncio.run(run())


async def waiting(gate: TenantGate, *tenants: str) -> list[asyncio.Task[None]]:
    """Let tenants wait, in this order."""
    tasks = [asyncio.create_task(gate.acquire(tenant)) for tenant in tenants]
    await asyncio.sleep(0.01)
    return tasks


def test_the_tenant_with_the_fewest_running_is_next() -> None:
    async def use(gate: TenantGate) -> None:
        first, second, other = await waiting(gate, "a", "a", "b")
        assert not any(task.done() for task in (first, second, other))
        gate.release("a")
        await asyncio.sleep(0.01)
        assert (first.done(), second.done(), other.done()) == (False, False, True)
        gate.release("b")
        await asyncio.sleep(0.01)
        assert (first.done(), second.done()) == (True, False)
        second.cancel()

    on_full_gate(use)


def test_a_tenant_may_wait_a_few_times() -> None:
    async def use(gate: TenantGate) -> None:
        tasks = await waiting(gate, *["a"] * MAX_WAITING_PER_TENANT)
        with pytest.raises(QuotaExceededError) as refused:
            await gate.acquire("a")
        assert refused.value.headers["Retry-After"]
        tasks += await waiting(gate, *(f"t{n}" for n in range(MAX_WAITING - len(tasks))))
        with pytest.raises(OverloadedError):
            await gate.acquire("z")
        for task in tasks:
            task.cancel()

    on_full_gate(use)


def test_who_is_gone_holds_no_turn() -> None:
    async def use(gate: TenantGate) -> None:
        gone, granted, last = await waiting(gate, "a", "b", "c")
        gone.cancel()
        await asyncio.sleep(0.01)
        gate.release("a")  # for b, which is gone before it learns so
        granted.cancel()
        await asyncio.sleep(0.01)
        assert last.done()
        assert not last.cancelled()

    on_full_gate(use)

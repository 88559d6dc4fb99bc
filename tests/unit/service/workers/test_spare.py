"""There is one child ahead, and none is left behind."""

from __future__ import annotations

from typing import Any

import pytest

from service.workers import spare as module
from service.workers.child import ChildLostError
from service.workers.spare import SpareChild
from tests.factories.attempts import FakeChild


class Children:
    """Makes children and remembers them."""

    def __init__(self) -> None:
        self.made: list[Any] = []
        self.are_ready = True

    def __call__(self) -> Any:
        child = FakeChild()
        child.wait_until_ready = lambda timeout_s: self.are_ready  # type: ignore[method-assign]
        child.is_alive = True  # type: ignore[attr-defined]
        self.made.append(child)
        return child


@pytest.fixture
def children(monkeypatch: pytest.MonkeyPatch) -> Children:
    made = Children()
    monkeypatch.setattr(module, "Child", made)
    return made


def test_a_child_is_started_once_until_it_is_taken(children: Children) -> None:
    spare = SpareChild()
    spare.start()
    spare.start()
    assert spare.wait_until_ready(1.0)
    assert spare.take() is children.made[0]
    assert len(children.made) == 1
    assert spare.take() is children.made[1]


def test_a_child_that_died_while_it_waited_is_replaced(children: Children) -> None:
    spare = SpareChild()
    spare.start()
    children.made[0].is_alive = False
    assert spare.take() is children.made[1]
    assert children.made[0].is_closed


def test_a_child_that_does_not_get_ready_is_lost(children: Children) -> None:
    children.are_ready = False
    with pytest.raises(ChildLostError):
        SpareChild().take()
    assert all(child.is_closed for child in children.made)


def test_a_child_that_ends_is_closed_with_the_next_one(children: Children) -> None:
    spare = SpareChild()
    first, second = spare.take(), spare.take()
    for child in (first, second):
        child.kill()
        spare.close_later(child)
    assert [child.is_closed for child in children.made] == [True, False]
    spare.close()
    assert children.made[1].is_closed

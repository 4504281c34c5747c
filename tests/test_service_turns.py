"""Turns to search in a service: alone, or beside others; nobody waits for ever, and nobody is passed over."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier, Event, Lock

import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.service.errors import ServiceError
from motionlake.service.turns import TOGETHER, Turns


class Watched:
    """Turns, and how many held one at once."""

    def __init__(self) -> None:
        self.turns, self._lock = Turns(20.0), Lock()
        self._within: list[bool] = []
        self.most, self.wrong = 0, 0

    def take(self, alone: bool) -> None:
        with self.turns.turn(alone=alone):
            with self._lock:
                self._within.append(alone)
                self.most = max(self.most, len(self._within))
                self.wrong += any(self._within) and len(self._within) > 1
            time.sleep(0.001)
            with self._lock:
                self._within.remove(alone)


@given(st.lists(st.booleans(), min_size=1, max_size=16))
def test_who_is_alone_is_alone_and_all_come_to_an_end(asked: Sequence[bool]) -> None:
    watched = Watched()
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(watched.take, asked))
    assert not watched.wrong
    assert watched.most <= TOGETHER


def test_two_run_at_once() -> None:
    turns, both = Turns(5.0), Barrier(TOGETHER, timeout=5)

    def search() -> None:
        with turns.turn(alone=False):
            both.wait()  # broken where one waits for the other

    with ThreadPoolExecutor(TOGETHER) as pool:
        for each in [pool.submit(search) for _ in range(TOGETHER)]:
            each.result()


@pytest.mark.parametrize("alone", [True, False])
def test_who_waits_too_long_is_told_so(alone: bool) -> None:
    """And gives back what it held: the next one comes at once."""
    turns = Turns(0.1)
    waiting = turns.turn(alone=alone)
    with turns.turn(alone=not alone), pytest.raises(ServiceError, match="others are searching"), waiting:
        pass
    for _ in range(2):
        with turns.turn():
            pass


def test_who_searches_alone_is_not_passed_over() -> None:
    """Of those that come later none is first, however many they are."""
    turns, begun, end, order = Turns(5.0), Event(), Event(), []

    def search(name: str, alone: bool) -> None:
        with turns.turn(alone=alone):
            order.append(name)
            begun.set()
            end.wait(5)

    with ThreadPoolExecutor(3) as pool:
        pool.submit(search, "first", False)
        assert begun.wait(5)
        pool.submit(search, "alone", True)
        time.sleep(0.1)  # it waits for the first
        pool.submit(search, "late", False)
        time.sleep(0.1)
        assert order == ["first"]
        end.set()
    assert order == ["first", "alone", "late"]

"""Work that threads share: every part once and in its order, whoever does it."""

from __future__ import annotations

import os
from threading import Barrier, get_ident
from time import sleep

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake import threads
from motionlake.threads import in_threads


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 99), max_size=40), st.integers(1, 6))
def test_every_part_is_done_once(parts: list[int], threads: int) -> None:
    done: list[int] = []

    def work(part: int) -> int:
        done.append(part)
        return part + 1

    assert in_threads(work, parts, threads) == [part + 1 for part in parts]
    assert sorted(done) == sorted(parts)


def test_threads_work_side_by_side_and_this_one_with_them() -> None:
    both = Barrier(2)

    def work(_: int) -> int:
        both.wait(30)
        return get_ident()

    assert get_ident() in in_threads(work, [0, 1], 2)
    for _ in range(3):
        in_threads(work, [0, 1], 2)
    assert len(threads._kept(os.getpid())._threads) <= (os.cpu_count() or 1)


def test_shared_work_within_shared_work_ends() -> None:
    """Were all threads to wait for work that is given out to threads, nothing would go on."""

    def work(part: int) -> int:
        return sum(in_threads(lambda each: each, list(range(part)), 4))

    assert in_threads(work, [5] * 64, 64) == [10] * 64


def test_the_first_error_is_told() -> None:
    def work(part: int) -> None:
        if part % 2:
            raise ValueError(str(part))

    with pytest.raises(ValueError, match=r"^1$"):
        in_threads(work, list(range(9)), 3)
    assert in_threads(str, [1, 2, 3], 3) == ["1", "2", "3"]


def test_who_interrupts_ends_what_is_left() -> None:
    done: list[int] = []

    def work(part: int) -> None:
        done.append(part)
        if get_ident() == own:
            raise KeyboardInterrupt
        sleep(0.01)

    own = get_ident()
    with pytest.raises(KeyboardInterrupt):
        in_threads(work, list(range(1000)), 2)
    before = len(done)
    sleep(0.05)
    assert before == len(done) < 1000

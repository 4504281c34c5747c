"""Benches of two checkouts, compared in turn."""

from __future__ import annotations

from pathlib import Path
from threading import Barrier

import pytest

from bench import against, trust_cost


def test_every_number_of_a_record_is_found_by_its_path() -> None:
    figures = {"rates": {"sum": 2, "words": 1.5}, "met": True, "note": "fast", "k": 100}
    assert dict(against.numbers(figures)) == {"rates/sum": 2.0, "rates/words": 1.5, "k": 100.0}


def test_checkouts_run_in_turn_and_medians_are_divided(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    order: list[Path] = []
    measured = {against.HERE: iter([4.0, 100.0, 6.0]), tmp_path: iter([2.0, 3.0, 1.0])}

    def run(checkout: Path, _name: str) -> dict[str, float]:
        order.append(checkout)
        return {"rate": next(measured[checkout]), "of one alone" if checkout == tmp_path else "of the other": 1.0}

    monkeypatch.setattr(against, "run_bench", run)
    assert against.compare(tmp_path, "dtw", rounds=3) == {"rate": 6.0 / 2.0}
    assert order == [against.HERE, tmp_path] * 3


def test_what_two_checkouts_take_is_measured_at_once_on_cores_that_change(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _process: {5, 3})
    both = Barrier(2, timeout=30)
    where: list[tuple[str, int]] = []
    taken = {"here": iter([9.0, 4.0, 2.0, 3.0]), "before": iter([9.0, 1.0, 4.0, 1.0])}

    def run(core: int, name: str, _checkout: Path) -> tuple[float, float]:
        both.wait()
        where.append((name, core))
        seconds = next(taken[name])
        return seconds, 2 * seconds

    found = trust_cost.side_by_side({"here": Path("a"), "before": Path("b")}, run, 3)
    assert [set(where[i : i + 2]) for i in (0, 2, 4, 6)] == 2 * [
        {("here", 3), ("before", 5)},
        {("here", 5), ("before", 3)},
    ]
    assert found["wall"] == {
        "ratio": 9 / 6, "standard error": pytest.approx(1.8028 / 3**0.5, abs=1e-4), "here, a round": 6.0,
        "before, a round": 4.0,
    }  # fmt: skip

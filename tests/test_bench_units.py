"""Units of benches that are kept, here or on another machine, and the records that name the machines."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from bench import record, units


def measured(folder: Path, wanted: list[int]) -> dict[int, dict[str, units.Found]]:
    """What is found of units, those kept in a folder included."""
    return dict(units.in_processes(lambda unit: {"row": {"square": unit**2}}, wanted, 1, str, folder))


def written(folder: Path, kept: Path | None) -> dict[str, Any]:
    return dict(json.loads(record.record("squares", {}, folder=folder, kept=kept).read_text(encoding="utf-8")))


def test_a_record_names_every_machine_that_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept, results = tmp_path / "kept", tmp_path / "results"
    here = {"machine": record.machine(), "versions": record.versions()}
    monkeypatch.setattr(record, "machine", lambda: {"processor": "another"})
    measured(kept, [1, 2])
    monkeypatch.undo()
    assert measured(kept, [1, 2]) == {1: {"row": {"square": 1}}, 2: {"row": {"square": 4}}}
    assert "machines" not in written(results, None)
    measured(kept, [2, 3])
    another, own = written(results, kept)["machines"]
    assert (another["machine"], own) == ({"processor": "another"}, here)


def test_a_record_names_another_machine_that_measured_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record, "machine", lambda: {"processor": "another"})
    measured(tmp_path / "kept", [1])
    monkeypatch.undo()
    (only,) = written(tmp_path / "results", tmp_path / "kept")["machines"]
    assert only["machine"] == {"processor": "another"}

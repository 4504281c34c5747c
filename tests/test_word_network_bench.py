"""The bench of the paper's word network stops after some minutes, and goes on from its record."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from bench import word_network
from bench.canonical_sets import SETS


def run(monkeypatch: pytest.MonkeyPatch, folder: Path, *words: str) -> dict[str, object]:
    """The record that a run writes; every unit has its seed for a mean average precision."""
    monkeypatch.setattr(sys, "argv", ["word_network", "hdm05", "salsa", "--rows", "raw words,linear", *words])
    monkeypatch.setattr("bench.record.RESULTS", folder / "results")
    monkeypatch.setattr(word_network, "measure", lambda keep, device, unit: {unit[1]: {"map": 0.1 * unit[2]}})
    monkeypatch.setenv("MOTIONLAKE_DATA", str(folder))
    word_network.main()
    newest = max((folder / "results").iterdir(), key=lambda path: path.stat().st_mtime_ns)
    return {**json.loads(newest.read_text(encoding="utf-8"))["figures"], "path": newest}


def test_a_run_that_is_cut_short_goes_on_from_its_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = tmp_path / SETS["hdm05"].folder / "a.bvh"
    recording.parent.mkdir(parents=True)
    recording.write_text("a", encoding="utf-8")
    first = run(monkeypatch, tmp_path, "--seeds", "2", "--minutes", "0")
    assert first["runs"] == {"raw words": {"hdm05": {"0": {"map": 0.0}}}}
    assert first["left"] == [
        "salsa, raw words, seed 0", "hdm05, linear, seed 0", "salsa, linear, seed 0", "hdm05, raw words, seed 1",
        "salsa, raw words, seed 1", "hdm05, linear, seed 1", "salsa, linear, seed 1",
    ]  # fmt: skip
    kept = Path(str(first["path"]))
    known = json.loads(kept.read_text(encoding="utf-8"))
    known["figures"]["runs"]["raw words"]["hdm05"]["0"]["map"] = 0.7  # what is in the record is not measured anew
    kept = kept.with_name("kept.json")
    kept.write_text(json.dumps(known), encoding="utf-8")
    second = run(monkeypatch, tmp_path, "--seeds", "2", "--from", str(kept))
    assert (second["left"], second["from"]) == ([], "kept")
    maps = second["map"]
    assert isinstance(maps, dict)
    assert maps["raw words"] == pytest.approx({"hdm05": 0.4, "salsa": 0.05})
    assert maps["linear"] == pytest.approx({"hdm05": 0.05, "salsa": 0.05})
    recording.write_text("b", encoding="utf-8")
    with pytest.raises(SystemExit, match="of the same recordings"):
        run(monkeypatch, tmp_path, "--from", str(kept))

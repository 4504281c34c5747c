"""The bench of every way to search, on a lake of a few clips."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from motionlake.lake.layout import open_lake
from motionlake.retrieval.registry import methods

from bench import scale_methods
from bench.scale_methods import cold, pieces, warm
from tests.lakes import query


def test_pieces_lie_in_the_midst_of_drawn_clips(built_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scale_methods, "PIECE", 0.2)
    lake = open_lake(built_lake)
    asked = pieces(lake, 5, 0)
    assert asked == pieces(lake, 5, 0)
    assert any(asked != pieces(lake, 5, seed) for seed in range(1, 9))
    clips = {clip: (frames, fps) for clip, frames, fps in query(built_lake, "SELECT clip, frames, fps FROM clips")}
    for each in asked:
        frames, fps = clips[each.name]
        assert each.start is not None
        assert each.stop is not None
        assert 0 < each.start < each.stop < frames
        assert each.stop - each.start == int(0.2 * fps)


@pytest.mark.parametrize("finds", ["clip", "range"])
def test_every_method_is_measured(built_lake: Path, monkeypatch: pytest.MonkeyPatch, finds: str) -> None:
    monkeypatch.setattr(scale_methods, "PIECE", 0.7)
    monkeypatch.setattr(scale_methods, "LONGER", 0.0)
    lake = open_lake(built_lake)
    asked = pieces(lake, 4, 0)
    for name in methods(finds):  # type: ignore[arg-type]
        found = json.loads(json.dumps(warm(lake, finds, name, asked)))  # type: ignore[arg-type]
        assert 0 < found["warm_ms"]["least"] <= found["warm_ms"]["median"] <= found["warm_ms"]["95"]
        assert found["refused"] < 4
        assert found.get("recall", 1.0) == 1.0, "a small lake compares every clip"
    times = cold(lake, finds, "moves", asked[0], 1)  # type: ignore[arg-type]
    assert all(len(each) == 1 and each[0] > 0 for each in times.values())

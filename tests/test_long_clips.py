"""Long clips made of recordings for measurements of scale: each depends on its number alone, and is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motionlake.formats import read_clips

from bench.long_clips import FASTEST, places, read_recordings, write_long_clips


@pytest.mark.parametrize("recorded", [1, 2, 3, 240])
def test_frames_go_to_the_end_and_back_in_small_steps(recorded: int) -> None:
    found = places(recorded, 2000, np.random.default_rng(0))
    assert found.min() >= 0
    assert found.max() <= recorded - 1
    assert np.abs(np.diff(found)).max() <= np.ceil(FASTEST)
    assert len(np.unique(found)) == recorded


def test_any_cut_writes_the_same_clips(recordings: Path, tmp_path: Path) -> None:
    sources = read_recordings(recordings)
    frames = write_long_clips(sources, 0, 6, tmp_path / "whole")
    assert frames == sum(write_long_clips(sources, a, b, tmp_path / "cut") for a, b in ((0, 2), (2, 6)))
    whole, cut = ({p.name: p.read_bytes() for p in (tmp_path / f).rglob("*.bvh")} for f in ("whole", "cut"))
    assert whole == cut
    assert len(set(whole.values())) == 6
    assert frames == sum(len(read_clips(path)[0].channels) for path in (tmp_path / "whole").rglob("*.bvh"))

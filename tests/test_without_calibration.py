"""A calibration pose at the beginning of a recording: the lake keeps it, and nothing is told of motion by it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motionlake.lake.frames import Frames, read_part

from tests.lakes import motionlake, query, quick_lake

CLIPS = 3
SAME_MOTION = {  # what is derived from frames, by clip
    "words": "SELECT start, stop, motif FROM words JOIN word_motifs USING (clip, word) WHERE clip = $clip ORDER BY 1",
    "signatures": "SELECT words, signature FROM signatures WHERE clip = $clip",
    "symbols": "SELECT symbols, starts FROM symbol_strings WHERE clip = $clip",
    "descriptors": "SELECT descriptor FROM descriptors WHERE clip = $clip",
    "submotions": "SELECT start, stop, descriptor FROM submotions WHERE clip = $clip ORDER BY 1, 2",
}


def without_first_frame(text: str) -> str:
    """A BVH whose first frame is a copy of its second."""
    lines = text.split("\n")
    first = next(i for i, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    return "\n".join([*lines[:first], lines[first + 1], *lines[first + 1 :]])


@pytest.fixture(scope="module")
def lake(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings of CMU, each of which begins with a T-pose, and the same without it."""
    folder = tmp_path_factory.mktemp("calibrated")
    source = folder / "clips"
    source.mkdir()
    paths = sorted((recordings / "cmu_bvh" / "clips").rglob("*.bvh"), key=lambda p: (p.stat().st_size, p.name))
    for path in paths[:CLIPS]:
        text = path.read_text(encoding="utf-8")
        (source / path.name).write_text(text, encoding="utf-8")
        (source / f"{path.stem}_without.bvh").write_text(without_first_frame(text), encoding="utf-8")
    root = quick_lake(folder / "lake")
    assert motionlake("ingest", source, "--lake", root).status == 0
    for stage in ("all", "quality"):
        ran = motionlake("run", stage, "--lake", root)
        assert ran.status == 0, ran.err
    return root


def pairs(lake: Path) -> list[tuple[str, str]]:
    clips = [str(clip) for (clip,) in query(lake, "SELECT clip FROM clips WHERE clip NOT LIKE '%_without.bvh'")]
    assert len(clips) == CLIPS
    return [(clip, clip.replace(".bvh", "_without.bvh")) for clip in clips]


def test_stored_frames_hold_the_calibration_pose(lake: Path) -> None:
    frames = {clip.clip: clip for path in sorted(lake.rglob("frames/**/*.parquet")) for clip in read_part(path)}
    for clip, other in pairs(lake):
        apart = np.linalg.norm(frames[clip].positions - frames[other].positions, axis=2).mean(axis=1)
        assert apart[0] > 0.1
        assert apart[1:].max() < 0.01


@pytest.mark.parametrize("table", SAME_MOTION)
def test_nothing_derived_tells_the_calibration_pose(lake: Path, table: str) -> None:
    for clip, other in pairs(lake):
        found, expected = (query(lake, SAME_MOTION[table], clip=name) for name in (clip, other))
        assert found == expected
        assert found


def test_a_file_with_a_calibration_pose_is_the_clip_without(lake: Path) -> None:
    for clip, other in pairs(lake):
        (file,) = query(lake, "SELECT root || '/' || path FROM sources WHERE dataset || '/' || path = $clip", clip=clip)
        for method in ("moves", "signature", "alignment", "descriptor"):
            run = motionlake("search", file[0], "--method", method, "-k", 2, "--json", "--lake", lake)
            assert run.status == 0, run.err
            hits = {hit["clip"]: hit["distance"] for hit in run.json}
            assert set(hits) == {clip, other}
            assert max(hits.values()) < 1e-2


def test_quality_tells_of_it(lake: Path) -> None:
    for clip, other in pairs(lake):
        (there,), (gone,) = (
            query(lake, "SELECT tpose_start > 0 FROM quality WHERE clip = $clip", clip=name) for name in (clip, other)
        )
        assert (there, gone) == ((True,), (False,))


def test_frames_keep_their_numbers() -> None:
    rng = np.random.default_rng(0)
    joints = np.cumsum(rng.normal(scale=1e-3, size=(60, 21, 3)), axis=0) + rng.normal(size=(21, 3))
    joints[:1] += 0.7 * rng.normal(size=(1, 21, 3))
    rotations = rng.normal(size=(60, 21, 4))
    found = Frames("a", 60.0, rotations, joints).recorded()
    np.testing.assert_array_equal(found.positions[1:], joints[1:])
    np.testing.assert_array_equal(found.positions[0], joints[1])
    np.testing.assert_array_equal(found.rotations[0], rotations[1])
    again = found.recorded()
    assert again is found

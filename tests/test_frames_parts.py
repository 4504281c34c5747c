"""A frames part explains itself: read alone, with pyarrow and numpy, and checked before it is believed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.lake.frames import KEY, VERSION, lengths, read_clip, read_clips, read_part

from tests.lakes import list_anew, motionlake, query


def footer(part: Path) -> dict[str, Any]:
    return dict(json.loads(pq.read_metadata(part).metadata[KEY.encode()]))


def turned(q: Float64Array, v: Float64Array) -> Float64Array:
    """Vectors [..., 3] turned by unit quaternions [..., 4] (w, x, y, z)."""
    w, axis = q[..., :1], q[..., 1:]
    return np.asarray(v + 2 * np.cross(axis, np.cross(axis, v) + w * v))


def product(a: Float64Array, b: Float64Array) -> Float64Array:
    w = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    return np.concatenate([w, a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])], -1)


def test_a_part_alone_gives_its_joints(built_lake: Path) -> None:
    """By the footer alone: joints follow from the root, the rotations and the rest offsets as it says they do."""
    limits = dict(query(built_lake, "SELECT clip, fk_error FROM clips"))
    checked = set()
    for part in built_lake.glob("frames/*/*.parquet"):
        said, table = footer(part), pq.ParquetFile(part).read()
        assert (said["version"], said["unit"], said["up"], said["rotations"]["order"]) == (
            VERSION,
            "metre",
            "y",
            "wxyz",
        )
        names = said["columns"]
        for clip, known in said["clips"].items():
            rows = table.filter(np.array(table.column("clip").to_pylist()) == clip)
            assert set(rows.column("fps").to_pylist()) == {known["fps"]}
            world: list[Float64Array] = []
            joints: list[Float64Array] = []
            for joint, parent, offset in zip(said["joints"], said["parents"], known["rest_offsets"], strict=True):
                own = np.column_stack([rows.column(c.format(joint=joint)).to_numpy() for c in names["rotation"]])
                own = own / np.linalg.norm(own, axis=1, keepdims=True)
                columns = [c.format(joint=joint) for c in (names["position"] if parent >= 0 else names["root"])]
                stored = np.column_stack([rows.column(c).to_numpy() for c in columns])
                world.append(own if parent < 0 else product(world[parent], own))
                joints.append(stored if parent < 0 else joints[parent] + turned(world[parent], np.array(offset)))
                # Stored numbers are multiples of 2^-13: some millimetres at the end of a chain of seven joints.
                assert np.abs(joints[-1] - stored).max() < limits[clip] + 0.003, (clip, joint)
            checked.add(clip)
    assert checked == set(limits)


def test_footers_and_the_catalog_agree(built_lake: Path) -> None:
    said = {
        clip: known for part in built_lake.glob("frames/*/*.parquet") for clip, known in footer(part)["clips"].items()
    }
    for clip, fps, offsets in query(built_lake, "SELECT clip, fps, rest_offsets FROM clips"):
        assert said[clip]["fps"] == fps
        np.testing.assert_allclose(np.ravel(said[clip]["rest_offsets"]), offsets, atol=1e-6)


def test_footers_are_small(built_lake: Path) -> None:
    """A clip adds less than 700 bytes, and Arrow keeps no second copy of it."""
    for part in built_lake.glob("frames/*/*.parquet"):
        kept = pq.read_metadata(part).metadata
        assert len(kept[KEY.encode()]) < 1500 + 700 * len(footer(part)["clips"])
        assert b"rest_offsets" not in kept[b"ARROW:schema"]


def rewritten(part: Path, **metadata: str) -> None:
    table = pq.ParquetFile(part).read()
    pq.write_table(table.replace_schema_metadata(metadata), part)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (
            lambda part: rewritten(part),
            "is a frames part of version 0, and version 1 is read here; `motionlake migrate`",
        ),
        (lambda part: rewritten(part, motion='{"version": 2}'), "is a frames part of version 2, and version 1 is read"),
        (
            lambda part: rewritten(part, motion='{"unit": "metre", "version": 3}'),
            "is a frames part of version 3, and version 1 is read",
        ),
        (lambda part: rewritten(part, motion="{"), "is a damaged frames part"),
        (lambda part: rewritten(part, motion="[]"), "is a damaged frames part"),
        (lambda part: part.write_bytes(part.read_bytes()[:-500]), "is a damaged frames part"),
    ],
    ids=["no footer", "newer", "newer, said later", "no JSON", "no object", "cut short"],
)
def test_a_part_of_another_version_is_not_read(built_lake: Path, tmp_path: Path, damage: Any, said: str) -> None:
    source = next(built_lake.glob("frames/*/*.parquet"))
    part = Path(shutil.copy(source, tmp_path / "part.parquet"))
    damage(part)
    clip = next(iter(footer(source)["clips"]))
    for read in (lambda: list(read_part(part)), lambda: read_clip(part, clip), lambda: lengths(part)):
        with pytest.raises(UserError, match="is a ") as raised:
            read()
        assert f"{part}: {said}" in str(raised.value)


def test_a_command_says_it_in_one_line(lake: Path) -> None:
    clip, part = query(lake, "SELECT clip, part FROM clips ORDER BY clip LIMIT 1")[0]
    rewritten(next(lake.glob(f"frames/*/{part}.parquet")), motion='{"version": 7}')
    list_anew(lake)
    run = motionlake("export", clip, "--rig", "canonical", "-o", lake / "out.bvh", "--lake", lake)
    assert (run.status, run.err.count("\n")) == (2, 1)
    assert f"{part}.parquet: is a frames part of version 7, and version 1 is read here; update motionlake" in run.err


def test_positions_are_the_same_without_rotations(built_lake: Path) -> None:
    for part in built_lake.glob("frames/*/*.parquet"):
        for whole, alone in zip(read_part(part), read_part(part, rotations=False), strict=True):
            assert (alone.clip, alone.fps) == (whole.clip, whole.fps)
            assert np.array_equal(alone.positions, whole.positions)
            assert alone.rotations.shape == (len(whole.positions), 0, 4)
            assert np.array_equal(alone.recorded().positions, whole.recorded().positions)


def test_clips_of_a_part_are_read_one_and_all_alike(built_lake: Path) -> None:
    for part in built_lake.glob("frames/*/*.parquet"):
        whole = {clip.clip: clip for clip in read_part(part)}
        assert lengths(part) == {name: (clip.fps, len(clip.positions)) for name, clip in whole.items()}
        some = sorted(whole)[::2]
        assert [clip.clip for clip in read_part(part, some)] == some
        for clip in [*read_clips(part, some), read_clip(part, some[0])]:
            assert clip.fps == whole[clip.clip].fps
            assert np.array_equal(clip.positions, whole[clip.clip].positions)
            assert np.array_equal(clip.rotations, whole[clip.clip].rotations)
        assert not list(read_clips(part, ["nowhere"]))
        with pytest.raises(UserError, match="does not hold nowhere"):
            read_clip(part, "nowhere")

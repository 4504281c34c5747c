"""GLB out and in: what is written is read back, and an independent reader and its own kinematics agree."""

from __future__ import annotations

import base64
import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.formats.parse.gltf_document import GltfDocument
from motionlake.formats.parse.keys import even_rate, sample
from motionlake.formats.parse.placings import Placing, Placings
from motionlake.formats.parse.scene import worlds
from motionlake.formats.parse.scene_trees import JointTree
from motionlake.formats.registry import companions
from motionlake.formats.write.glb import glb_bytes
from motionlake.formats.write.registry import ClipToWrite, writers
from motionlake.motion.clip import POSITION_CHANNELS, SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import normalise, rotate, to_matrix

from tests.lakes import motionlake, query, quick_lake
from tests.samples import SAMPLES


def source(folder: Path, suffix: str = ".bvh") -> SourceClip:
    path = folder / f"source{suffix}"
    path.write_bytes(SAMPLES[suffix](folder))
    return read_clips(path)[0]


def written(clip: SourceClip, path: Path, up: str = "y", unit: float = 0.01) -> Path:
    writers()["glb"].write(ClipToWrite("walk", clip, unit, up, {"licence": "CC0"}), path)
    return path


def naive_positions(path: Path, frame: int) -> dict[str, Float64Array]:
    """Joints of one frame, by pygltflib's reading and matrices multiplied one after another."""
    import pygltflib

    gltf = pygltflib.GLTF2().load(str(path))
    blob = gltf.binary_blob()

    def array(index: int) -> Float64Array:
        accessor = gltf.accessors[index]
        view = gltf.bufferViews[accessor.bufferView]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor.type]
        flat = np.frombuffer(blob, "<f4", accessor.count * width, view.byteOffset + (accessor.byteOffset or 0))
        return flat.reshape(accessor.count, width).astype(float)

    state: dict[tuple[int, str], Float64Array] = {}
    for channel in gltf.animations[0].channels:
        values = array(gltf.animations[0].samplers[channel.sampler].output)
        state[channel.target.node, channel.target.path] = values[frame]
    parent = {child: number for number, node in enumerate(gltf.nodes) for child in node.children or []}

    def world(node: int) -> Float64Array:
        own = gltf.nodes[node]
        x, y, z, w = state.get((node, "rotation"), own.rotation or (0, 0, 0, 1))
        matrix = np.eye(4)
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        matrix[:3, :3] *= own.scale or (1, 1, 1)
        matrix[:3, 3] = state.get((node, "translation"), own.translation or (0, 0, 0))
        return world(parent[node]) @ matrix if node in parent else matrix

    return {gltf.nodes[joint].name: world(joint)[:3, 3] for joint in gltf.skins[0].joints}


@pytest.mark.parametrize(("suffix", "unit", "up"), [(".bvh", 0.01, "y"), (".amc", 0.05, "z"), (".npz", 1.0, "y")])
def test_what_is_written_is_read_back(tmp_path: Path, suffix: str, unit: float, up: str) -> None:
    clip = source(tmp_path, suffix)
    path = written(clip, tmp_path / "walk.glb", up, unit)
    back = read_clips(path)[0]
    turned = solve(clip).positions * unit
    if up == "z":
        turned = turned[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    assert back.hierarchy.joints == clip.hierarchy.joints
    assert (back.up, back.metres_per_unit) == ("y", 1.0)
    np.testing.assert_allclose(back.fps, clip.fps, rtol=1e-3)
    np.testing.assert_allclose(solve(back).positions, turned, atol=1e-5)
    for frame in (0, len(turned) - 1):
        naive = naive_positions(path, frame)
        for joint, name in enumerate(back.hierarchy.joints):
            np.testing.assert_allclose(solve(back).positions[frame, joint], naive[name], atol=1e-5)
    assert list(tmp_path.glob(".*.tmp")) == []


def parts(data: bytes) -> tuple[dict[str, Any], bytes]:
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def as_gltf(document: dict[str, Any], binary: bytes, uri: str = "") -> bytes:
    document["buffers"][0]["uri"] = uri or "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    return json.dumps(document).encode()


@pytest.mark.parametrize(("way", "bones_less"), [(0.0, 0), (100.0, 1)])
def test_a_joint_that_leaves_its_parent_hangs_on_no_bone(tmp_path: Path, way: float, bones_less: int) -> None:
    clip = source(tmp_path)
    own, first = clip.hierarchy.channels, len(clip.hierarchy.channels[0])
    hierarchy = replace(clip.hierarchy, channels=(own[0], (*POSITION_CHANNELS, *own[1]), *own[2:]))
    places = (
        np.tile(clip.hierarchy.offsets[1], (len(clip.channels), 1)) + np.linspace(0, way, len(clip.channels))[:, None]
    )
    moving = replace(
        clip, hierarchy=hierarchy, channels=np.hstack([clip.channels[:, :first], places, clip.channels[:, first:]])
    )
    assert (
        corners(written(moving, tmp_path / "moving.glb")) == corners(written(clip, tmp_path / "a.glb")) - 6 * bones_less
    )


def corners(path: Path) -> int:
    data = path.read_bytes()
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    accessor: int = document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    count: int = document["accessors"][accessor]["count"]
    return count


def test_a_scaled_and_turned_node_above_the_joints_moves_them(tmp_path: Path) -> None:
    clip = source(tmp_path)
    document, binary = parts(glb_bytes(ClipToWrite("walk", clip, 1.0)))
    half = float(np.sqrt(0.5))
    document["nodes"].append(
        {"name": "Armature", "children": [0], "scale": [0.01] * 3, "rotation": [-half, 0, 0, half]}
    )
    path = tmp_path / "walk.gltf"
    path.write_bytes(as_gltf(document, binary))
    back = read_clips(path)[0]
    expected = rotate(np.array([half, -half, 0.0, 0.0]), solve(clip).positions) * 0.01
    np.testing.assert_allclose(solve(back).positions, expected, atol=1e-6)
    assert sum("Xposition" in names for names in back.hierarchy.channels) == 1


def test_every_take_and_every_body_is_a_clip(tmp_path: Path) -> None:
    document, binary = parts(glb_bytes(ClipToWrite("walk", source(tmp_path, ".npz"), 1.0)))
    document["animations"].append(document["animations"][0] | {"name": "run"})
    path = tmp_path / "two.gltf"
    path.write_bytes(as_gltf(document, binary))
    assert [clip.body for clip in read_clips(path)] == ["walk", "run"]


def test_a_buffer_lies_beside_the_file_and_nowhere_else(tmp_path: Path) -> None:
    document, binary = parts(glb_bytes(ClipToWrite("walk", source(tmp_path), 0.01)))
    path = tmp_path / "walk.gltf"
    path.write_bytes(as_gltf(document, binary, "my%20motion.bin"))
    assert companions(path) == [tmp_path / "my motion.bin"]
    with pytest.raises(ClipError, match=r"its buffer my motion\.bin does not exist"):
        read_clips(path)
    (tmp_path / "my motion.bin").write_bytes(binary)
    assert len(read_clips(path)[0].channels) == 4
    for outside in ("../secret.bin", "/etc/passwd", "http://example.org/x.bin", "a\\..\\b", "%2e%2e/x"):
        path.write_bytes(as_gltf(document, binary, outside))
        with pytest.raises(ClipError, match="is no file beside it"):
            read_clips(path)


def test_a_file_without_skin_or_animation_says_so(tmp_path: Path) -> None:
    document, binary = parts(glb_bytes(ClipToWrite("walk", source(tmp_path), 0.01)))
    path = tmp_path / "walk.gltf"
    for gone, reason in (("skins", "has no skin"), ("animations", "has no animation that moves")):
        path.write_bytes(as_gltf({name: value for name, value in document.items() if name != gone}, binary))
        with pytest.raises(ClipError, match=reason):
            read_clips(path)


@pytest.mark.parametrize("what", ["count", "byteLength", "byteStride", "byteOffset"])
def test_counts_beyond_the_bytes_are_turned_away(tmp_path: Path, what: str) -> None:
    document, binary = parts(glb_bytes(ClipToWrite("walk", source(tmp_path), 0.01)))
    for holder in document["accessors" if what == "count" else "bufferViews"]:
        holder[what] = 1_000_000_000_000 if what == "count" else 4_000_000
    path = tmp_path / "walk.gltf"
    path.write_bytes(as_gltf(document, binary))
    with pytest.raises(ClipError, match=r"promises|MiB of memory"):
        read_clips(path)


@settings(max_examples=60, deadline=None)
@given(
    count=st.integers(1, 9),
    kind=st.sampled_from([("VEC3", 3), ("VEC4", 4), ("SCALAR", 1)]),
    component=st.sampled_from([(5120, "i1"), (5121, "u1"), (5122, "i2"), (5123, "u2"), (5126, "f4")]),
    gap=st.integers(0, 5),
    offset=st.integers(0, 7),
    share=st.booleans(),
    seed=st.integers(0, 2**32),
    replaced=st.booleans(),
)
def test_accessors_hold_the_numbers_that_were_laid_down(
    count: int, kind: tuple[str, int], component: tuple[int, str], gap: int, offset: int, share: bool, seed: int,
    replaced: bool,
) -> None:  # fmt: skip
    rng = np.random.default_rng(seed)
    values = rng.integers(0, 100, (count, kind[1])).astype(f"<{component[1]}")
    rows = [row.tobytes() + bytes(gap) for row in values]
    data = bytes(offset) + b"".join(rows)
    accessor = {"bufferView": 0, "count": count, "type": kind[0], "componentType": component[0], "normalized": share}
    views = [{"buffer": 0, "byteOffset": offset, "byteLength": len(data) - offset, "byteStride": len(rows[0])}]
    if replaced:
        values[count - 1] = 7
        views += [{"buffer": 0, "byteOffset": len(data) + at, "byteLength": size} for at, size in ((0, 1), (1, 32))]
        data += bytes([count - 1]) + values[count - 1].tobytes().ljust(32, b"\0")
        indices = {"bufferView": 1, "componentType": 5121}
        accessor["sparse"] = {"count": 1, "indices": indices, "values": {"bufferView": 2}}
    document = {"accessors": [accessor], "bufferViews": views, "buffers": [{"byteLength": len(data)}]}
    read = GltfDocument(document, data, {}).accessor(0, (kind[0],))
    whole = {"i1": 127, "u1": 255, "i2": 32767, "u2": 65535}.get(component[1]) if share else None
    np.testing.assert_allclose(read, values.astype(float) / (whole or 1))


def test_keys_are_sampled_as_the_file_says() -> None:
    times = np.array([0.0, 1.0])
    at = np.array([0.0, 0.25, 0.999, 1.0, 2.0])
    line = np.array([[0.0], [4.0]])
    np.testing.assert_allclose(sample(times, line, at, "LINEAR", False)[:, 0], [0, 1, 3.996, 4, 4])
    np.testing.assert_allclose(sample(times, line, at, "STEP", False)[:, 0], [0, 0, 0, 4, 4])
    cubic = np.array([[0.0], [0.0], [4.0], [4.0], [4.0], [0.0]])  # tangents of the line
    np.testing.assert_allclose(sample(times, cubic, at, "CUBICSPLINE", False)[:, 0], [0, 1, 3.996, 4, 4])
    turns = np.array([[1.0, 0, 0, 0], [-np.sqrt(0.5), -np.sqrt(0.5), 0, 0]])
    half = sample(times, turns, np.array([0.5]), "LINEAR", True)[0]
    np.testing.assert_allclose(np.abs(half), [np.cos(np.pi / 8), np.sin(np.pi / 8), 0, 0], atol=1e-12)


def test_keys_at_every_instant_are_taken_as_they_are() -> None:
    rng = np.random.default_rng(3)
    times = (np.arange(40, dtype=np.float32) / np.float32(120)).astype(float)
    for values, rotation in ((rng.standard_normal((40, 3)), False), (rng.standard_normal((40, 4)), True)):
        expected = values / np.linalg.norm(values, axis=1, keepdims=True) if rotation else values
        np.testing.assert_allclose(sample(times, values, np.arange(40) / 120, "LINEAR", rotation), expected)
    halfway = sample(times, values[:, :1], (np.arange(39) + 0.5) / 120, "LINEAR", False)
    np.testing.assert_allclose(halfway, (values[:-1, :1] + values[1:, :1]) / 2, atol=1e-4)


@pytest.mark.parametrize("scaled", [(), (0,), (2,), (1, 3)])
def test_chains_of_nodes_agree_with_matrices_multiplied_one_after_another(scaled: tuple[int, ...]) -> None:
    rng, parents, frames = np.random.default_rng(5), (-1, 0, 1, 2, 2), 6
    placings = [
        Placing(
            rng.standard_normal((frames, 3)),
            normalise(rng.standard_normal((frames, 4))),
            np.tile([1.5, 0.5, 2.0] if node in scaled else [1.0, 1.0, 1.0], (frames, 1)),
        )
        for node in range(len(parents))
    ]
    found = worlds(JointTree(tuple(range(5)), parents, 0), Placings.of(placings), frames)
    for frame in range(frames):
        matrices: list[Float64Array] = []
        for parent, placing in zip(parents, placings, strict=True):
            own = np.eye(4)
            own[:3, :3] = to_matrix(placing.rotation[frame]) @ np.diag(placing.scale[frame])
            own[:3, 3] = placing.translation[frame]
            matrices.append(own if parent < 0 else matrices[parent] @ own)
        np.testing.assert_allclose(found.positions[frame], [matrix[:3, 3] for matrix in matrices], atol=1e-12)


def test_the_rate_is_that_of_the_keys_or_thirty() -> None:
    single = np.arange(50, dtype=np.float32)
    for rate in (24, 25, 30, 60, 120):
        assert even_rate((single / np.float32(rate)).astype(float))[0] == rate
    assert even_rate(np.array([0.0, 2.0, 5.0]))[0] == 30.0


@pytest.mark.recordings
def test_a_real_clip_goes_out_as_glb_and_into_a_lake(recordings: Path, tmp_path: Path, scheduler: str) -> None:
    clip = read_clips(min((recordings / "bandai1").rglob("*.bvh"), key=lambda path: path.stat().st_size))[0]
    (tmp_path / "in").mkdir()
    written(clip, tmp_path / "in" / "walk.glb")
    lake = quick_lake(tmp_path / "lake")
    run = motionlake("ingest", tmp_path / "in", "--lake", lake, "--scheduler", scheduler, "--json")
    assert run.status == 0, run.err
    [(name, frames)] = query(lake, "SELECT format, frames FROM clips")
    assert (name, frames) == ("glTF", len(clip.channels))

"""Every command of docs/from-files.md runs on a folder as the page describes it, and does what the page says."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.lakes import QUICK, on_cluster, query, quick_lake
from tests.marker_samples import c3d_bytes, mot_text, motive_skeleton, motive_text, walking_angles
from tests.samples import (
    AMC,
    ASF,
    BVH,
    KINECT_1,
    KINECT_1_PARENTS,
    deepmimic_frames,
    deepmimic_text,
    kinect_2_from_1,
    npz_bytes,
    ntu_text,
    plug_in_gait_markers,
    swinging_body,
)

PAGE = (Path(__file__).parents[1] / "docs" / "from-files.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    motionlake (.+)$", PAGE, re.MULTILINE)


def positions(count: int, turned: bool = False) -> bytes:
    """A body of a Kinect; or the same with z up, in centimetres."""
    body = swinging_body(count)
    if turned:
        body = 100 * np.stack([body[..., 0], -body[..., 2], body[..., 1]], axis=-1)
    return npz_bytes(body, KINECT_1, KINECT_1_PARENTS, 30.0)


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scheduler: str) -> Path:
    """The folders that the page speaks of; `bvh` holds a motion as motionlake writes it, `strange` with other names."""
    tables = re.findall(r"^```\n(file,.*?)```", PAGE, re.MULTILINE | re.DOTALL)
    ntu = ntu_text([(str(i), 0, kinect_2_from_1(swinging_body(40))) for i in (1, 2)])
    files: dict[str, bytes] = {
        "ntu/S001C001P001R001A050.skeleton": ntu.encode(),
        "deepmimic/walk.txt": deepmimic_text(deepmimic_frames(50)).encode(),
        "deepmimic/notes.txt": b"taken on a Monday",
        "c3d/take.c3d": c3d_bytes(*plug_in_gait_markers(swinging_body(40))),
        "motive/take.csv": motive_text(motive_skeleton(40)).encode(),
        "opensim/walk.mot": mot_text(walking_angles(40)).encode(),
        "positions/take.npz": positions(40),
        "zup/take.npz": positions(40, turned=True),
        "labelled/take1.npz": positions(40),
        "labelled/take2.npz": positions(50),
        "labelled/labels.csv": tables[0].encode(),
        "labelled/segments.csv": tables[1].encode(),
        "asf/sample.asf": ASF.encode(),
        "asf/sample_01.amc": AMC.encode(),
        "shots/broken.bvh": BVH.encode()[:200],
    }
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content)
    shutil.copy(tmp_path / "deepmimic" / "walk.txt", tmp_path / "shots")
    monkeypatch.chdir(tmp_path)
    quick_lake(tmp_path / "first")
    (tmp_path / "gltf").mkdir()
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "labels.csv").write_text("file,label\nwalk.csv,walk\n")
    for words in (
        ["ingest", "deepmimic", "--lake", "first"],
        ["export", "walk", "--rig", "canonical", "-o", "walk.bvh", "--lake", "first"],
        ["export", "walk", "--rig", "canonical", "--format", "glb", "-o", "gltf/walk.glb", "--lake", "first"],
        ["export", "walk", "--rig", "canonical", "--format", "csv", "-o", "tables/walk.csv", "--lake", "first"],
    ):
        run = on_cluster(words, scheduler)
        assert run.status == 0, run.err
    for folder in ("bvh", "strange"):
        (tmp_path / folder).mkdir()
        shutil.copy(tmp_path / "walk.bvh", tmp_path / folder)
    text = (tmp_path / "strange" / "walk.bvh").read_text(encoding="utf-8")
    named = re.sub(r"^(\s*(?:ROOT|JOINT) )(\w+)$", r"\1rig_\2_bone", text, flags=re.MULTILINE)
    (tmp_path / "strange" / "walk.bvh").write_text(named.replace("hips", "Becken"), encoding="utf-8")
    return tmp_path


def test_every_command_of_the_page(folders: Path, scheduler: str) -> None:
    lake = quick_lake(folders / "mylake", QUICK)
    assert len(COMMANDS) > 15
    for line in COMMANDS:
        words = shlex.split(line)
        if words[:2] == ["run", "all"]:  # as README does, which is run
            continue
        run = on_cluster(words, scheduler)
        rejected = words[:2] in (["ingest", "shots"], ["ingest", "asf"])  # a broken file; the sample is no whole body
        assert run.status in ((0, 1) if rejected else (0,)), f"{line}: {run.err}"
    rows = {row[0]: row[1:] for row in query(lake, "SELECT clip, format, rig, label, licence, body_height FROM clips")}
    assert {clip.split("/")[0] for clip in rows} >= {
        "bvh", "ntu", "deepmimic", "positions", "strange", "zup", "labelled", "shots",
    }  # fmt: skip
    assert {"ntu/S001C001P001R001A050.skeleton#1", "ntu/S001C001P001R001A050.skeleton#2"} < set(rows)
    assert rows["strange/walk.bvh"][1].startswith("auto:")
    assert rows["bvh/walk.bvh"][1] == "canonical"
    assert rows["gltf/walk.glb"][:2] == ("glTF", "canonical")
    assert rows["c3d/take.c3d"][:2] == ("C3D", "markers")
    assert rows["motive/take.csv"][:2] == ("Motive CSV", "motive")
    assert rows["opensim/walk.mot"][:2] == ("OpenSim motion", "opensim")
    assert rows["tables/walk.csv"][:3] == ("table", "canonical", "walk")
    assert rows["labelled/take2.npz"][2] == "walk"
    assert rows["positions/take.npz"][3] == "CC-BY-4.0"
    assert rows["zup/take.npz"][4] == pytest.approx(rows["positions/take.npz"][4], rel=1e-3)
    assert query(lake, "SELECT dataset, path FROM rejects WHERE dataset = 'shots'") == [("shots", "broken.bvh")]
    assert query(lake, "SELECT label FROM segments ORDER BY start") == [("wave",), ("stand",)]

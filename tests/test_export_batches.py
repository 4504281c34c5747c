"""Many clips out of a lake at once: chosen by SQL or a list, on the user's character, in every format."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import c3d
import duckdb
import numpy as np
import pandas as pd
import pytest
from motionlake.formats import read_clips
from motionlake.formats.write.registry import SetWriter, Writer, set_writers, writers
from motionlake.motion.kinematics import solve

from tests.characters import HERO, hero_bvh
from tests.lakes import ingested_lake, motionlake, query


@pytest.fixture(scope="module")
def lake(tmp_path_factory: pytest.TempPathFactory, clips_folder: Path, scheduler: str) -> Path:
    return ingested_lake(tmp_path_factory.mktemp("export") / "lake", clips_folder, scheduler)


def exported(lake: Path, out: Path, *words: object, status: int = 0) -> dict[str, Any]:
    """What the manifest says of an export into a folder."""
    run = motionlake("export", "--lake", lake, "--out", out, *words)
    assert run.status == status, run.err
    found: dict[str, Any] = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    return found


def turning(lake: Path) -> list[str]:
    """The clips whose joints turn."""
    rows = query(lake, "SELECT clip FROM clips JOIN layouts USING (layout) WHERE kind <> 'positions' ORDER BY clip")
    return [clip for (clip,) in rows]


def test_writers_are_found_by_themselves() -> None:
    assert {"bvh", "csv", "c3d", "glb"} <= writers().keys()
    assert "lerobot" in set_writers()
    assert not writers().keys() & set_writers().keys()
    assert all(isinstance(each, Writer) and each.suffix.startswith(".") for each in writers().values())
    assert all(isinstance(each, SetWriter) for each in set_writers().values())


def test_a_condition_chooses_clips(lake: Path, tmp_path: Path) -> None:
    label = query(lake, "SELECT min(label) FROM clips")[0][0]
    wanted = query(lake, "SELECT clip, content_hash, frames FROM clips WHERE label = $label ORDER BY clip", label=label)
    found = exported(lake, tmp_path / "out", "--where", f"label = '{label}'")
    assert [(row["clip"], row["content_hash"], row["stop"]) for row in found["clips"]] == wanted
    assert found["failed"] == []
    for row in found["clips"]:
        assert len(read_clips(tmp_path / "out" / row["file"])[0].channels) == row["frames"] == row["stop"]
        assert row["label"] == label
        assert row["transforms"] == []
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "croissant.json", "manifest.json", *(row["file"] for row in found["clips"])
    }  # fmt: skip


@pytest.mark.parametrize(
    "condition",
    [
        "clip IN (SELECT content FROM read_text('/etc/passwd'))",
        "label = ",
        "true; DROP TABLE clips",
        "nowhere = 3",
        "(SELECT count(*) FROM read_csv('/etc/passwd')) > 0",
    ],
)
def test_a_condition_reads_the_lake_and_nothing_else(lake: Path, tmp_path: Path, condition: str) -> None:
    run = motionlake("export", "--lake", lake, "--where", condition, "--out", tmp_path / "out")
    assert run.status == 2
    assert run.err.startswith("motionlake: --where: ")
    assert not (tmp_path / "out").exists()


def test_a_query_chooses_ranges(lake: Path, tmp_path: Path) -> None:
    text = "SELECT clip, unnest([2, 5]) AS start, start + 6 AS stop FROM clips"
    (tmp_path / "kicks.sql").write_text(text)
    found = exported(lake, tmp_path / "out", "--sql", tmp_path / "kicks.sql", "--rig", "canonical")
    clips = query(lake, "SELECT clip FROM clips ORDER BY clip")
    assert sorted((row["clip"], row["start"], row["stop"]) for row in found["clips"]) == [
        (clip, start, start + 6) for (clip,) in clips for start in (2, 5)
    ]
    assert len({row["file"] for row in found["clips"]}) == 2 * len(clips)
    whole = exported(lake, tmp_path / "whole", "--dataset", "clips", "--rig", "canonical")
    files = {row["clip"]: row["file"] for row in whole["clips"]}
    one = found["clips"][0]
    piece = solve(read_clips(tmp_path / "out" / one["file"])[0]).positions
    every = solve(read_clips(tmp_path / "whole" / files[one["clip"]])[0]).positions
    np.testing.assert_allclose(piece, every[one["start"] : one["stop"]], atol=1e-3)


@pytest.mark.parametrize("name", ["list.csv", "list.json", "lines.json"])
def test_a_list_chooses_ranges(lake: Path, tmp_path: Path, name: str) -> None:
    clips = [clip for (clip,) in query(lake, "SELECT clip FROM clips ORDER BY clip LIMIT 3")]
    rows: list[dict[str, Any]] = [
        {"clip": clip, "start": 1, "stop": 4 + at, "rank": at} for at, clip in enumerate(clips)
    ]
    file = tmp_path / name
    if name == "list.csv":
        with file.open("w", newline="") as stream:
            writer = csv.DictWriter(stream, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    else:
        file.write_text(json.dumps(rows) if name == "list.json" else "\n".join(map(json.dumps, rows)))
    found = exported(lake, tmp_path / "out", "--list", file, "--format", "csv")
    assert [(row["clip"], row["start"], row["stop"]) for row in found["clips"]] == [
        (row["clip"], row["start"], row["stop"]) for row in rows
    ]


def test_rows_without_a_clip_are_of_the_one_that_is_named(lake: Path, tmp_path: Path) -> None:
    clip = query(lake, "SELECT min(clip) FROM clips")[0][0]
    (tmp_path / "bands.json").write_text('[{"start": 0, "stop": 5, "label": "a"}]')
    found = exported(lake, tmp_path / "out", clip, "--list", tmp_path / "bands.json")
    assert [(row["clip"], row["stop"]) for row in found["clips"]] == [(clip, 5)]


def test_what_cannot_be_written_leaves_the_others(lake: Path, tmp_path: Path) -> None:
    clips = [clip for (clip,) in query(lake, "SELECT clip FROM clips ORDER BY clip LIMIT 2")]
    (tmp_path / "list.csv").write_text(f"clip,start,stop\n{clips[0]},0,100000\n{clips[1]},0,5\n")
    found = exported(lake, tmp_path / "out", "--list", tmp_path / "list.csv", status=1)
    assert [row["clip"] for row in found["clips"]] == [clips[1]]
    assert found["failed"][0]["clip"] == clips[0]
    assert "are not a range" in found["failed"][0]["reason"]


def test_nothing_is_written_over_without_a_word(lake: Path, tmp_path: Path) -> None:
    first = exported(lake, tmp_path / "out", "--dataset", "clips")
    mine = tmp_path / "out" / first["clips"][0]["file"]
    mine.write_text("mine")
    (tmp_path / "out" / "manifest.json").unlink()
    (tmp_path / "out" / "notes.txt").write_text("my own")
    run = motionlake("export", "--lake", lake, "--dataset", "clips", "--out", tmp_path / "out")
    assert run.status == 2
    assert "is there already" in run.err
    assert mine.read_text() == "mine"
    exported(lake, tmp_path / "out", "--dataset", "clips", "--overwrite")
    assert mine.read_text() != "mine"
    assert (tmp_path / "out" / "notes.txt").read_text() == "my own"


def test_clips_on_the_user_s_character(lake: Path, tmp_path: Path) -> None:
    (tmp_path / "hero.bvh").write_text(hero_bvh())
    words = ("--dataset", "clips", "--rig", tmp_path / "hero.bvh", "--fps", 24, "--tpose")
    found = exported(lake, tmp_path / "out", *words)
    rows = query(lake, "SELECT clip, frames, fps, rig FROM clips ORDER BY clip")
    assert len(found["clips"]) == len(rows)
    for row, (clip, frames, fps, rig) in zip(found["clips"], rows, strict=True):
        made = read_clips(tmp_path / "out" / row["file"])[0]
        assert row["clip"] == clip
        assert made.fps == row["fps"] == 24
        assert len(made.channels) == row["frames"] == int((frames - 1) / fps * 24 + 1e-6) + 2
        assert list(made.hierarchy.joints) == list(HERO)
        done = {name: value for step in row["transforms"] for name, value in step.items()}
        assert (done["retargeted_from"], done["to"], done["resampled_from"]) == (rig, "hero.bvh", fps)
        assert 0.5 < done["scale"] < 3
        first = solve(made).positions[0]
        place = {name: first[joint] for joint, name in enumerate(made.hierarchy.joints)}
        arm = place["LeftHand"] - place["LeftArm"]
        assert abs(arm[1]) < 1e-3 * np.linalg.norm(arm), "the first frame is a T-pose"


@pytest.mark.parametrize("rig", ["own", "canonical"])
def test_a_t_pose_comes_first_on_other_rigs(lake: Path, tmp_path: Path, rig: str) -> None:
    clip = turning(lake)[0]
    frames = query(lake, "SELECT frames FROM clips WHERE clip = $clip", clip=clip)[0][0]
    for name, more in (("a.bvh", ["--tpose"]), ("b.bvh", [])):
        run = motionlake("export", clip, "--lake", lake, "--rig", rig, "-o", tmp_path / name, *more)
        assert run.status == 0, run.err
    posed, plain = (solve(read_clips(tmp_path / name)[0]).positions for name in ("a.bvh", "b.bvh"))
    assert len(posed) == frames + 1
    np.testing.assert_allclose(posed[1:], plain, atol=1e-3 * np.abs(plain - plain[:, :1]).max())


def test_a_glb_is_a_character_too(lake: Path, tmp_path: Path) -> None:
    # Without toes in the file nobody knows how high over the floor its ankles are.
    with_toes = query(lake, "SELECT clip FROM clips WHERE NOT list_contains(filled, 'left_toe') ORDER BY clip")
    clip = next((clip for (clip,) in with_toes if clip in turning(lake)), None)
    if clip is None:
        pytest.skip("no made clip has toes and turns")
    where = ("--where", f"clip = '{clip}'")
    found = exported(lake, tmp_path / "hero", *where, "--rig", "canonical", "--format", "glb")
    assert found["sources"] == {"clips": []}
    hero = tmp_path / "hero" / found["clips"][0]["file"]
    places = []
    for name, rig in (("a", hero), ("b", "canonical")):
        (row,) = exported(lake, tmp_path / name, *where, "--rig", rig, "--format", "csv")["clips"]
        places.append(np.loadtxt(tmp_path / name / row["file"], delimiter=",", skiprows=1))
    np.testing.assert_allclose(places[0], places[1], atol=0.02)


def test_clips_are_chosen_by_their_faults(lake: Path, tmp_path: Path, scheduler: str) -> None:
    own = tmp_path / "lake"
    shutil.copytree(lake, own)
    asked = ("export", "--lake", own, "--format", "csv", "--out", tmp_path / "out", "--where")
    refused = motionlake(*asked, "quality.slide < 0.5")
    assert (refused.status, "motionlake run quality" in refused.err) == (2, True), refused.err
    assert motionlake("run", "quality", "--lake", own, "--scheduler", scheduler).status == 0
    median = query(own, "SELECT median(limb_drift) FROM quality")[0][0]
    steady = {row[0] for row in query(own, f"SELECT clip FROM quality WHERE limb_drift <= {median!r}")}
    assert len(steady) > 0
    run = motionlake(*asked, f"quality.limb_drift <= {median!r}")
    assert run.status == 0, run.err
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text(encoding="utf-8"))
    assert {row["clip"] for row in manifest["clips"]} == steady


def test_csv_says_where_joints_are(lake: Path, tmp_path: Path) -> None:
    found = exported(lake, tmp_path / "out", "--dataset", "clips", "--format", "csv", "--rig", "canonical")
    for row in found["clips"]:
        table = pd.read_csv(tmp_path / "out" / row["file"])
        tree = json.loads((tmp_path / "out" / row["file"].replace(".csv", ".joints.json")).read_text())
        np.testing.assert_allclose(table["time"], np.arange(row["frames"]) / row["fps"], atol=1e-6)
        joints = [(joint, axis) for joint in ("left_ankle", "head") for axis in "xyz"]
        text = f"SELECT {', '.join(map('_'.join, joints))} FROM frames WHERE clip = $clip ORDER BY frame"
        stored = np.array(query(lake, text, clip=row["clip"]))
        written = table[list(map(".".join, joints))].to_numpy()
        assert np.median(np.abs(written - stored)) < 0.02
        assert list(table.columns[1::3]) == [f"{joint}.x" for joint in tree["joints"]]
        assert tree["parents"][0] == -1


@pytest.mark.filterwarnings("ignore:No analog data")
def test_c3d_opens_in_another_library(lake: Path, tmp_path: Path) -> None:
    words = ("--dataset", "clips", "--rig", "canonical")
    found = exported(lake, tmp_path / "out", *words, "--format", "c3d")
    beside = exported(lake, tmp_path / "csv", *words, "--format", "csv")
    for row, other in zip(found["clips"], beside["clips"], strict=True):
        with (tmp_path / "out" / row["file"]).open("rb") as stream:
            reader = c3d.Reader(stream)
            points = np.array([frame[1][:, :3] for frame in reader.read_frames()])
        table = pd.read_csv(tmp_path / "csv" / other["file"])
        assert reader.point_rate == pytest.approx(row["fps"])
        assert [f"{label.strip()}.x" for label in reader.point_labels] == list(table.columns[1::3])
        np.testing.assert_allclose(points.reshape(len(table), -1) / 1000, table.to_numpy()[:, 1:], atol=1e-5)


def test_a_lerobot_set_is_as_published(lake: Path, tmp_path: Path) -> None:
    """Read as LeRobot v3.0 says: info tells where data lie, episodes which rows are theirs, tasks what an index is."""
    out = tmp_path / "out"
    words = ("--format", "lerobot", "--rig", "canonical", "--fps", 30)
    found = exported(lake, out, "--dataset", "clips", *words)
    info = json.loads((out / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert (info["fps"], info["total_episodes"]) == (30, len(found["clips"]))
    episodes = pd.concat(map(pd.read_parquet, sorted(out.glob("meta/episodes/*/*.parquet"))))
    tasks = pd.read_parquet(out / "meta/tasks.parquet")
    assert tasks.index.name == "task"
    assert info["total_tasks"] == len(tasks)
    first = 0
    for (_, episode), row in zip(episodes.iterrows(), found["clips"], strict=True):
        chunk, file = episode["data/chunk_index"], episode["data/file_index"]
        data = pd.read_parquet(out / info["data_path"].format(chunk_index=chunk, file_index=file))
        assert set(data.columns) == set(info["features"])
        data = data[data["index"].between(episode["dataset_from_index"], episode["dataset_to_index"] - 1)]
        assert (data["episode_index"] == episode["episode_index"]).all()
        assert (episode["dataset_from_index"], len(data)) == (first, row["frames"])
        assert list(data["frame_index"]) == list(range(len(data)))
        np.testing.assert_allclose(data["timestamp"], np.arange(len(data)) / 30, atol=1e-5)
        said = tasks.index[tasks["task_index"].isin(data["task_index"])]
        assert list(said) == list(episode["tasks"]) == [row["label"]]
        state, action = (np.stack(data[name]) for name in ("observation.state", "action"))
        assert state.shape[1:] == tuple(info["features"]["observation.state"]["shape"])
        np.testing.assert_array_equal(action[:-1], state[1:])
        np.testing.assert_allclose(episode["stats/observation.state/mean"], state.mean(0), atol=1e-5)
        first += len(data)
    assert info["total_frames"] == first
    stats = json.loads((out / "meta/stats.json").read_text())
    text = f"SELECT max(list_extract(\"observation.state\", 2)) FROM '{out}/data/*/*.parquet'"
    assert stats["observation.state"]["max"][1] == pytest.approx(duckdb.execute(text).fetchall()[0][0])
    assert stats["action"]["count"] == [first]
    run = motionlake("export", "--lake", lake, "--dataset", "clips", *words, "--out", out)
    assert (run.status, "is not empty" in run.err) == (2, True)
    exported(lake, out, "--dataset", "clips", *words, "--overwrite")


def test_a_set_leaves_out_what_does_not_fit(lake: Path, tmp_path: Path) -> None:
    rates = query(lake, "SELECT DISTINCT fps FROM clips")
    if len(rates) < 2:
        pytest.skip("all made clips have one rate")
    found = exported(
        lake, tmp_path / "out", "--dataset", "clips", "--format", "lerobot", "--rig", "canonical", status=1
    )
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert info["total_episodes"] == len(found["clips"])
    assert len({row["fps"] for row in found["clips"]}) == 1
    assert all("say --fps" in row["reason"] for row in found["failed"])


@pytest.mark.parametrize(
    ("words", "part"),
    [
        ([], "name a clip"),
        (["--where", "true"], "--out"),
        (["--where", "false", "--out", "{out}"], "no clip is chosen"),
        (["--where", "true", "--format", "docx", "--out", "{out}"], "--format docx: use"),
        (["--where", "true", "--from", "3", "--out", "{out}"], "--from and --to are of one clip"),
        (["--where", "true", "--fps", "0", "--out", "{out}"], "--fps 0"),
        (["--list", "{out}.txt", "--out", "{out}"], "cannot be read"),
        (["--sql", "SELECT 1 AS x", "--out", "{out}"], "row 1 has no clip"),
        (["--sql", "SELECT min(clip) AS clip, -1 AS start FROM clips", "--out", "{out}"], "-1 is no frame"),
        (["--sql", "SELECT min(clip) AS clip, 'x' AS start FROM clips", "--out", "{out}"], "row 1"),
    ],
)
def test_a_mistake_gets_one_clear_line(lake: Path, tmp_path: Path, words: list[str], part: str) -> None:
    run = motionlake("export", "--lake", lake, *(word.format(out=tmp_path / "out") for word in words))
    assert run.status == 2
    assert part in run.err
    assert len(run.err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()

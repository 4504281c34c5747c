"""Faults of recordings: each check on a body of which everything is known, on real recordings, and by command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.cli.check import _Checked, _tell_in_place
from motionlake.motion.canonicalise import CanonicalMotion
from motionlake.motion.kinematics import forward_kinematics
from motionlake.motion.quality import KINDS, MEASURES, Fault, Recording, check, sentence
from motionlake.motion.quality.clock import falls, steps
from motionlake.motion.quality.feet import Ground
from motionlake.motion.quality.mend import mended
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.rotations import IDENTITY, from_axis_angle, multiply, normalise
from motionlake.motion.skeleton import INDEX, PARENTS

from bench.plants import PLANTS, Subject
from tests.lakes import motionlake, query
from tests.test_lake_format import described, real

FPS = 60.0
FRAMES = 480
CONFIG = QualityConfig()
BONES = {
    "spine": (0, 0.12, 0), "chest": (0, 0.15, 0), "neck": (0, 0.25, 0), "head": (0, 0.12, 0.02),
    "clavicle": (0.04, 0.2, 0), "shoulder": (0.14, 0, 0), "elbow": (0.28, 0, 0), "wrist": (0.25, 0, 0),
    "hip": (0.09, -0.04, 0), "knee": (0, -0.42, 0), "ankle": (0, -0.41, 0), "toe": (0, -0.05, 0.14),
}  # fmt: skip


def offsets() -> Float64Array:
    found = np.zeros((len(PARENTS), 3))
    for name, joint in INDEX.items():
        side, _, part = name.rpartition("_")
        if part in BONES:
            found[joint] = np.array(BONES[part]) * (-1 if side == "right" else 1, 1, 1)
    return found


def standing(frames: int = FRAMES) -> Subject:
    """A body that stands on its feet, sways its trunk and swings its arms, which hang down."""
    random = np.random.default_rng(0)
    time = np.arange(frames) / FPS
    rotations = np.tile(IDENTITY, (frames, len(PARENTS), 1))
    for name, joint in INDEX.items():
        if name == "hips" or any(part in name for part in ("hip", "knee", "ankle", "toe")):
            continue
        angles = [a * np.sin(2 * np.pi * f * time + p) for a, f, p in random.uniform((3, 0.3, 0), (9, 0.7, 6), (3, 3))]
        for axis, angle in zip(np.eye(3), angles, strict=True):
            rotations[:, joint] = multiply(rotations[:, joint], from_axis_angle(axis, angle))
    for side, sign in (("left", -1), ("right", 1)):
        joint = INDEX[f"{side}_shoulder"]
        down = from_axis_angle(np.array([0.0, 0.0, 1.0]), sign * 70.0)
        rotations[:, joint] = multiply(down, rotations[:, joint])
        elbow = INDEX[f"{side}_elbow"]  # bent: a straight one that is held there is no fault
        rotations[:, elbow] = multiply(from_axis_angle(np.array([0.0, -sign, 0.0]), 35.0), rotations[:, elbow])
        bends = {"hip": -20.0, "knee": 30.0, "ankle": -10.0}
        for part, degrees in bends.items():
            sway = degrees + np.zeros(frames)
            rotations[:, INDEX[f"{side}_{part}"]] = from_axis_angle(np.array([1.0, 0.0, 0.0]), sway)
    rest = offsets()
    root = np.tile([0.0, 0.88, 0.0], (frames, 1))
    rotations = normalise(rotations)
    return Subject("standing", Recording(forward_kinematics(root, rotations, rest), rotations, FPS), rest)


def kinds(recording: Recording) -> set[str]:
    return {fault.kind for fault in check(recording, CONFIG).faults}


def test_a_body_without_faults_has_none() -> None:
    quality = check(standing().recording, CONFIG)
    assert (quality.verdict, quality.faults, quality.share) == ("ok", [], 0.0)
    assert tuple(quality.measures) == MEASURES


# What a body that stands can show: its frame rate is told by nothing.
@pytest.mark.parametrize("kind", [kind for kind in PLANTS if kind not in ("fps", "seam")])
def test_a_planted_fault_is_found_where_it_is(kind: str) -> None:
    found = 0
    for seed in range(8):
        made = PLANTS[kind](standing(), np.random.default_rng(seed))
        if made is None:
            continue
        faults = [fault for fault in check(made.recording, CONFIG).faults if fault.kind == kind]
        assert faults, f"{kind} by seed {seed}"
        assert any(fault.start < made.stop + 2 and fault.stop > made.start - 2 for fault in faults)
        assert all(0 <= fault.start < fault.stop <= len(made.recording) for fault in faults)
        found += 1
    assert found >= 2


def test_measures_are_those_of_the_fault() -> None:
    body = standing().recording
    shift = np.clip(np.arange(FRAMES) - 100, 0, 120)[:, None, None] * np.array([0.4, 0, 0]) / FPS
    (slide,) = check(replace(body, positions=body.positions + shift), CONFIG).faults
    assert (slide.kind, slide.joint[-5:]) == ("slide", "ankle")
    assert slide.severity == pytest.approx(0.4, rel=0.05)
    assert abs(slide.start - 100) <= 4
    assert abs(slide.stop - 220) <= 4
    low = (np.abs(np.arange(FRAMES) - 200) < 40)[:, None, None] * np.array([0, -0.12, 0])
    sunk = next(
        f for f in check(replace(body, positions=body.positions + low), CONFIG).faults if f.kind == "penetration"
    )
    assert (sunk.start, sunk.stop, round(sunk.severity, 3)) == (161, 240, 0.12)


def test_a_foot_that_trembles_in_its_place_does_not_slide() -> None:
    body = standing().recording
    frames = np.arange(FRAMES)
    for far, told in ((0.02, set()), (0.15, {"slide"})):  # to and fro by so many metres, at most .4 m/s
        turn = 0.8 / far * np.clip(frames - 100, 0, 200) / FPS
        shift = far / 2 * (1 - np.cos(turn))[:, None, None] * np.array([1.0, 0, 0])
        moved = replace(body, positions=body.positions + shift)
        assert {f.kind for f in check(moved, CONFIG).faults} & {"slide"} == told
        assert "slide" in {f.kind for f in check(moved, replace(CONFIG, slide_way=0.0)).faults}


def test_one_line_names_the_clips_that_walk_in_place(capsys: pytest.CaptureFixture[str]) -> None:
    quality = check(standing().recording, CONFIG)
    walks = [
        _Checked(f"walk_{number}", None, replace(quality, measures={**quality.measures, "in_place": speed}), quality)
        for number, speed in enumerate((0.0, 1.32, 0.8, 1.0, 1.1))
    ]
    _tell_in_place(walks[:1])
    assert capsys.readouterr() == ("", "")
    _tell_in_place(walks)
    told = "walk_1 (1.32 m/s), walk_2 (0.80 m/s), walk_3 (1.00 m/s) and 1 more; that is no slide\n"
    assert capsys.readouterr().err == "on a treadmill, or with their way taken out: " + told


def test_a_body_that_is_dragged_is_not_on_a_treadmill() -> None:
    body = standing().recording
    dragged = body.positions + np.arange(FRAMES)[:, None, None] * np.array([0.4, 0, 0]) / FPS
    quality = check(replace(body, positions=dragged), CONFIG)
    assert quality.measures["in_place"] == 0
    assert [fault.kind for fault in quality.faults] == ["slide"]


def test_a_loop_is_seen_even_where_nothing_jumps() -> None:
    body = standing(240).recording
    turn = 2 * np.pi * np.arange(240) / 80  # three times the same second and a third, without any jump
    rotations = body.rotations.copy()
    rotations[:] = rotations[:1]
    for joint, phase in ((INDEX["left_shoulder"], 0.0), (INDEX["right_elbow"], 1.5)):  # no pose comes twice in a turn
        wave = from_axis_angle(np.array([0.0, 1.0, 0.0]), 20 * np.sin(turn[np.arange(240) % 80] + phase))
        rotations[:, joint] = multiply(rotations[:, joint], wave)
    seams = [f for f in check(replace(body, rotations=rotations), CONFIG).faults if f.kind == "seam"]
    assert [fault.start + 1 for fault in seams] == [80]


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_a_fall_tells_the_frame_rate(factor: float) -> None:
    body = standing().recording
    time = np.clip((np.arange(FRAMES) - 200) / FPS, 0, 0.6)
    height = 9.81 / 2 * time * (0.6 - time)
    jump = replace(body, positions=body.positions + height[:, None, None] * np.array([0, 1, 0]), fps=FPS * factor)
    assert falls(jump, Ground.of(jump)) == pytest.approx([factor], rel=0.05)
    assert ("fps" in kinds(jump)) == (factor != 1)


def test_what_is_too_short_is_ok() -> None:
    body = standing().recording
    for frames in (1, 2, 3, 5, 8, 20):
        assert check(body.part(0, frames), CONFIG).verdict == "ok"


def test_thresholds_are_those_of_the_configuration() -> None:
    body = standing().recording
    noise = np.random.default_rng(0).normal(0, 0.004, body.positions.shape)
    noisy = replace(body, positions=body.positions + noise)
    assert "jitter" in kinds(noisy)
    assert "jitter" not in {f.kind for f in check(noisy, replace(CONFIG, jitter=0.02)).faults}


@pytest.mark.parametrize("kind", KINDS)
def test_every_fault_has_a_sentence(kind: str) -> None:
    said = sentence(Fault(kind=kind, joint="left_ankle", start=60, stop=120, severity=0.31), 60.0)
    assert "{" not in said
    assert ("left ankle" in said) == (
        kind in ("slide", "penetration", "jitter", "spike", "flip", "frozen", "limb_drift")
    )


def test_missing_joints_are_told() -> None:
    body = standing().recording
    quality = check(replace(body, repaired=24), CONFIG)
    (fault,) = quality.faults
    assert (fault.kind, fault.severity, quality.measures["missing"]) == ("missing", 0.05, 0.05)
    assert (quality.verdict, quality.share) == ("doubtful", 0.05)
    assert check(replace(body, repaired=60), CONFIG).verdict == "bad"
    assert check(replace(body, repaired=9), CONFIG).verdict == "ok"


def motion_of(subject: Subject, recording: Recording) -> CanonicalMotion:
    return CanonicalMotion(
        fps=recording.fps, root=recording.positions[:, 0], rotations=recording.rotations,
        positions=recording.positions, rest_offsets=subject.rest_offsets, body_height=recording.height, twist=True,
        filled=(), up="y", metres_per_unit=1.0, fk_error=0.0, fk_error_mean=0.0,
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["spike", "flip", "tpose_start", "tpose_end"])
def test_what_was_planted_is_mended(kind: str) -> None:
    subject, tried = standing(), 0
    for seed in range(6):
        made = PLANTS[kind](subject, np.random.default_rng(seed))
        if made is None:
            continue
        broken = motion_of(subject, made.recording)
        kept = broken.rotations.copy()
        copy, done = mended(broken, check(made.recording, CONFIG).faults)
        assert {each.fault for each in done} == {kind}
        after = replace(made.recording, positions=copy.positions, rotations=copy.rotations)
        assert kinds(after) == set()
        if kind.startswith("tpose"):
            assert len(copy) == FRAMES
        assert np.abs(copy.positions - subject.recording.positions).max() < 0.03
        assert np.array_equal(broken.rotations, kept), "the source stays as it was"
        tried += 1
    assert tried >= 3


def test_jitter_is_smoothed() -> None:
    subject = standing()
    rotations = subject.recording.rotations.copy()
    noise = np.random.default_rng(0).normal(0, 0.02, rotations[100:200].shape)
    rotations[100:200] = normalise(rotations[100:200] + noise)
    places = forward_kinematics(subject.recording.positions[:, 0], rotations, subject.rest_offsets)
    noisy = replace(subject.recording, rotations=rotations, positions=places)
    faults = [fault for fault in check(noisy, CONFIG).faults if fault.kind == "jitter"]
    copy, done = mended(motion_of(subject, noisy), faults)
    assert {each.how for each in done} == {"smoothed"}
    before, after = (np.abs(p[110:190] - subject.recording.positions[110:190]).mean() for p in (places, copy.positions))
    assert after < 0.7 * before


def test_only_t_poses_leave_nothing() -> None:
    subject = standing(90)
    still = replace(subject.recording, rotations=np.tile(IDENTITY, (90, len(PARENTS), 1)))
    places = forward_kinematics(still.positions[:, 0], still.rotations, subject.rest_offsets)
    still = replace(still, positions=places)
    with pytest.raises(ValueError, match="nothing is left"):
        mended(motion_of(subject, still), check(still, CONFIG).faults)


@pytest.fixture(scope="module")
def walks(recordings: Path) -> list[Recording]:
    from motionlake.formats import read_clips
    from motionlake.motion.canonicalise import canonicalise
    from motionlake.motion.kinematics import solve
    from motionlake.motion.rigs import identify, load_rigs

    found = []
    for name in ("02_01", "35_05", "08_01"):
        clip = read_clips(recordings / "cmu_bvh" / "clips" / f"{name}.bvh")[0]
        motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs()))
        found.append(
            Recording.of(motion.positions, motion.rotations, motion.fps, twist=motion.twist, filled=motion.filled)
        )
    return found


@pytest.mark.recordings
def test_real_walks_have_a_calibration_pose_and_nothing_else(walks: list[Recording]) -> None:
    for walk in walks:
        (fault,) = [f for f in check(walk, CONFIG).faults if f.kind != "spike"]
        assert (fault.kind, fault.start, fault.stop) == ("tpose_start", 0, 1)


@pytest.mark.recordings
@pytest.mark.parametrize("way", ["a treadmill", "all of its way"])
def test_who_walks_in_place_does_not_slide(walks: list[Recording], way: str) -> None:
    for walk in walks[:2]:
        walk = walk.part(1, len(walk))
        hips = walk.joint("hips") * np.array([1, 0, 1])
        if way == "a treadmill":
            hips = np.linspace(hips[0], hips[-1], len(walk))
        stays = check(replace(walk, positions=walk.positions - hips[:, None]), CONFIG)
        speed = np.linalg.norm(hips[-1] - hips[0]) * walk.fps / (len(walk) - 1)
        assert stays.measures["in_place"] == pytest.approx(speed, rel=0.15)
        assert check(walk, CONFIG).measures["in_place"] == 0
        assert "slide" not in {fault.kind for fault in stays.faults}


@pytest.mark.recordings
@pytest.mark.parametrize("factor", [0.25, 0.5, 2.0, 4.0])
def test_real_walks_tell_their_frame_rate(walks: list[Recording], factor: float) -> None:
    for walk in walks:
        (right,), (wrong,) = steps(walk), steps(replace(walk, fps=walk.fps * factor))
        assert 0.7 < right < 1.4
        assert wrong == pytest.approx(right * factor)
        assert "fps" in kinds(replace(walk, fps=walk.fps * factor))


def test_the_stage_and_the_command_find_the_same(lake: Path, scheduler: str, tmp_path: Path) -> None:
    run = motionlake("run", "quality", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    told = motionlake("check", "--lake", lake, "--json", "--picture", tmp_path / "faults.png")
    stored = {
        name: (verdict, slide) for name, verdict, slide in query(lake, "SELECT clip, verdict, slide FROM quality")
    }
    assert {row["clip"]: (row["verdict"], row["measures"]["slide"]) for row in told.json} == stored
    ranges = sorted(query(lake, "SELECT clip, fault, joint, start, stop FROM quality_ranges"))
    assert ranges == sorted(
        (row["clip"], f["kind"], f["joint"], f["start"], f["stop"]) for row in told.json for f in row["faults"]
    )
    assert told.status == any(row["verdict"] == "bad" for row in told.json)
    page, there = described(), real(lake)
    assert all(page[name] == there[name] for name in page if name.startswith("quality"))
    order = [("bad", "doubtful", "ok").index(row["verdict"]) for row in told.json]
    assert order == sorted(order)
    assert (tmp_path / "faults.png").read_bytes().startswith(b"\x89PNG")
    again = motionlake("run", "quality", "--lake", lake, "--scheduler", scheduler, "--json")
    assert [row["shards"] for row in again.json] == [0]


def test_a_file_that_is_in_no_lake_is_checked(lake: Path, clips_folder: Path, tmp_path: Path) -> None:
    file = next(path for path in sorted(clips_folder.rglob("*")) if path.suffix in (".bvh", ".amc", ".npz", ".txt"))
    told = motionlake("check", file, "--lake", lake, "--json", "--picture", tmp_path / "faults.html")
    (row,) = told.json
    assert row["clip"] == str(file)
    assert row["verdict"] in ("ok", "doubtful", "bad")
    assert b"Faults of recordings" in (tmp_path / "faults.html").read_bytes()


def test_mended_copies_say_what_was_mended(lake: Path, clips_folder: Path, tmp_path: Path) -> None:
    clip = query(lake, "SELECT min(clip) FROM clips")[0][0]
    before = {path: path.read_bytes() for path in lake.rglob("*.parquet")}
    told = motionlake("clean", clip, "--out", tmp_path / "mended", "--lake", lake, "--json")
    (row,) = told.json
    lineage = json.loads(Path(row["file"]).with_suffix(".json").read_text(encoding="utf-8"))
    assert lineage["source"] == clip
    assert len(lineage["mended"]) == row["mended"]
    assert lineage["verdict_after"] == row["verdict"]
    assert motionlake("check", row["file"], "--lake", lake, "--json").json[0]["verdict"] == row["verdict"]
    assert {path: path.read_bytes() for path in lake.rglob("*.parquet")} == before
    again = motionlake("clean", clip, "--out", tmp_path / "mended", "--lake", lake)
    assert again.status == 2
    assert "is there already" in again.err


def test_mistakes_are_told(lake: Path) -> None:
    assert "must end in .png or .html" in motionlake("check", "--picture", "faults.gif", "--lake", lake).err
    assert motionlake("check", "no_such_clip", "--lake", lake).status == 2

"""Motion through given poses, and ranges of clips made anew: on real recordings left out, and in a lake three ways."""

from __future__ import annotations

import json
import shutil
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.api import Lake
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.evaluation.synthesis.movement import bone_length_drift, energy
from motionlake.glogen.config import LocGenRecipe
from motionlake.glogen.inbetweening import locgen_network
from motionlake.glogen.keyed import keyed_motion, sparse_rows
from motionlake.glogen.sparse import poses_at
from motionlake.glogen.trajectories import body_motion
from motionlake.matching.generator import MatchingGenerator
from motionlake.matching.inbetweening import Inbetweens
from motionlake.matching.keyed_feet import still
from motionlake.matching.recordings import longest_range
from motionlake.matching.style import style_costs
from motionlake.motion.generation import FPS, Control, MotionRequest
from motionlake.motion.keyframes import KeyPoses, even_stretch, ground_below, through
from motionlake.motion.kinematics import forward_kinematics
from motionlake.motion.rotations import angle, from_vectors
from motionlake.stages.synthesis_keys import marked

from bench.canonical_sets import LabelledClip
from bench.matching import clips_of
from bench.matching_clips import database_of, offsets_of, seed_of
from tests.lakes import motionlake as command
from tests.lakes import query

EXACT = 1e-9  # metres, by which a motion may miss a pose


@cache
def generator() -> MatchingGenerator:
    """Walks, every third left out."""
    clips = [clip for i, clip in enumerate(clips_of("walk")[:24]) if i % 3]
    return MatchingGenerator(database_of(clips, "walk"))


def keyed(clip: LabelledClip, seconds: float) -> tuple[KeyPoses, Float64Array]:
    """Poses of a clip so many seconds apart, and the recorded joints from the first to the last, 30 frames a second."""
    start, stop = longest_range(clip.positions, clip.rotations, clip.fps)
    frames = np.arange(start, stop, round(seconds * clip.fps))
    poses, turns = clip.positions[frames, 0].astype(float), clip.rotations[frames].astype(float)
    own = slice(start, frames[-1] + 1, round(clip.fps / FPS))
    keys = KeyPoses(np.round((frames - start) / clip.fps * FPS).astype(int), poses, turns)
    return keys, forward_kinematics(clip.positions[own, 0], clip.rotations[own].astype(float), offsets_of(clip))


def missed(made: Float64Array, keys: KeyPoses, body: Float64Array) -> float:
    return float(np.abs(made[keys.frames] - forward_kinematics(keys.hips, keys.rotations, body)).max())


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 9999), st.lists(st.integers(1, 20), min_size=1, max_size=4))
def test_any_stretch_is_bent_through_any_poses(seed: int, gaps: list[int]) -> None:
    rng = np.random.default_rng(seed)
    frames = np.concatenate([[0], np.cumsum(gaps)])
    turns = from_vectors(rng.normal(0, 0.6, (len(frames), 21, 3)))
    keys = KeyPoses(frames, rng.normal(size=(len(frames), 3)), turns)
    other = KeyPoses(frames, keys.hips + rng.normal(0, 0.2, keys.hips.shape), keys.rotations[::-1])
    for source, recorded in ((keys, False), (other, True)):
        stretches = [even_stretch(source, i) for i in range(len(gaps))]
        stretches = [type(one)(one.hips, one.rotations, recorded) for one in stretches]
        hips, rotations = through(keys, stretches)
        np.testing.assert_allclose(hips[frames], keys.hips, atol=EXACT)
        assert angle(rotations[frames], keys.rotations).max() < 1e-5
        np.testing.assert_allclose(np.linalg.norm(rotations, axis=-1), 1, atol=EXACT)
    hips, _ = through(keys, [even_stretch(keys, i) for i in range(len(gaps))])
    for i, (start, stop) in enumerate(pairwise(frames)):  # nothing overshoots
        low, high = np.minimum(*keys.hips[i : i + 2]), np.maximum(*keys.hips[i : i + 2])
        assert (hips[start : stop + 1] >= low - EXACT).all()
        assert (hips[start : stop + 1] <= high + EXACT).all()


@pytest.mark.recordings
def test_poses_of_a_recording_lead_to_that_recording(recordings: Path) -> None:
    clip = clips_of("walk")[1]
    keys, _ = keyed(clip, 0.5)
    ground = ground_below(clip.positions, clip.name)
    keys = KeyPoses(keys.frames, keys.hips - [0, ground, 0], keys.rotations)
    data = generator().database
    for i, run in enumerate(Inbetweens(data, [0], offsets_of(clip)).runs(keys, np.random.default_rng(0))):
        assert run is not None
        piece = data.piece_of[run.row]
        assert data.clips[piece] == f"walk/{clip.name}"
        assert not run.mirrored
        assert abs(run.row - data.pieces[piece, 0] - keys.frames[i]) <= 1


@pytest.mark.recordings
@pytest.mark.parametrize("number", [0, 3, 6])
def test_a_clip_left_out_is_filled_in(recordings: Path, number: int) -> None:
    clip = clips_of("walk")[number]
    keys, true = keyed(clip, 0.5)
    request = MotionRequest(("walk",), 1.0, 0, seed_of(clip), temperature=0.0, keys=keys)
    (made,) = generator().generate([request])
    body = offsets_of(clip)
    assert missed(made.positions, keys, body) < EXACT
    assert bone_length_drift(made.positions, body) < 1e-6
    even = forward_kinematics(*through(keys, [even_stretch(keys, i) for i in range(len(keys.frames) - 1)]), body)
    mine, lines = (np.linalg.norm(one - true[: len(one)], axis=-1).mean() for one in (made.positions, even))
    assert mine < 0.6 * lines
    assert (
        np.linalg.norm(np.diff(made.positions, axis=0), axis=-1).max()
        < 1.5 * np.linalg.norm(np.diff(true, axis=0), axis=-1).max()
    )
    assert all(source.clip != f"walk/{clip.name}" for source in made.sources)
    stops = [source.stop for source in made.sources]
    assert [source.start for source in made.sources] == [0, *stops[:-1]]
    assert stops[-1] == len(made.positions)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 9999))
def test_feet_are_held_but_at_the_poses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    keys = np.array([0, 12, 13, 30])
    standing = np.repeat(rng.random(8) < 0.6, 4)[:31]
    foot = np.cumsum(rng.normal(0, 0.01, (31, 2, 3)), axis=0)
    change = still(foot, standing, keys, 5, 10.0)
    np.testing.assert_allclose(change[keys], 0, atol=EXACT)
    np.testing.assert_array_equal(change[:, 1], 0)
    moved = (foot + change[:, None])[..., [0, 2]]
    for start, stop in pairwise(keys):
        own = np.arange(start, stop + 1)
        if standing[own].all():  # from where one pose has it evenly to where the next does
            speeds = np.linalg.norm(np.diff(moved[own], axis=0), axis=-1)
            assert np.ptp(speeds, axis=0).min() < EXACT


@pytest.mark.recordings
def test_a_style_is_taken_on(recordings: Path) -> None:
    clips = clips_of("walk")
    data = generator().database
    style = next(clip for i, clip in enumerate(clips[:24]) if i % 3 == 1 and clip.subject != clips[0].subject)
    costs = style_costs(data, seed_of(style))
    piece = data.clips.index(f"walk/{style.name}")
    own = np.zeros(2 * len(data), dtype=bool)
    own[data.pieces[piece, 0] : data.pieces[piece, 1]] = True
    assert costs[own].max() < 1e-3 < np.median(costs[~own])

    def share(control: Control | None) -> float:
        requests = [MotionRequest(("walk",), 6.0, seed, seed_of(clips[0]), control=control) for seed in (0, 1, 2)]
        sources = [source for made in generator().generate(requests) for source in made.sources]
        frames = [source.stop - source.start for source in sources]
        return sum(n for n, s in zip(frames, sources, strict=True) if s.clip == f"walk/{style.name}") / sum(frames)

    assert share(Control(style=seed_of(style))) > 2 * share(None)


@pytest.mark.recordings
def test_a_pose_far_off_in_time_is_walked_to(recordings: Path) -> None:
    clip = clips_of("walk")[3]
    keys, true = keyed(clip, 3.6)
    far = KeyPoses(keys.frames[[0, 1]], keys.hips[[0, 1]], keys.rotations[[0, 1]])
    request = MotionRequest(("walk",), 1.0, 0, seed_of(clip), keys=far)
    (made,) = generator().generate([request])
    assert missed(made.positions, far, offsets_of(clip)) < EXACT
    assert energy(made.positions, FPS) > 0.5 * energy(true[: len(made.positions)], FPS)


@pytest.mark.recordings
def test_locgen_leads_through_a_persons_poses(recordings: Path) -> None:
    clip = clips_of("walk")[0]
    keys, _ = keyed(clip, 0.25)
    network = locgen_network(LocGenRecipe()).eval()
    made = keyed_motion(network, MotionRequest(("walk",), 1.0, 0, seed_of(clip), keys=keys))
    assert missed(made.positions, keys, offsets_of(clip)) < EXACT
    # The poses as the thesis's interface has them are those that it finds in a recording.
    start, stop = longest_range(clip.positions, clip.rotations, clip.fps)
    motion = body_motion(clip.positions[start:stop], clip.fps)
    known = poses_at(motion, keys.frames.astype(float)).rows
    rows = sparse_rows(keys, offsets_of(clip), ground_below(clip.positions, clip.name))
    np.testing.assert_allclose(rows[1:, :60], known[1:, :60], atol=0.06)
    np.testing.assert_allclose(rows[1:, -4:], known[1:, -4:], atol=0.1)


def test_how_keyframes_are_written() -> None:
    one = marked("set/a@b.bvh@120=2.5")
    assert (one.source, one.place, one.in_seconds, one.seconds) == ("set/a@b.bvh", 120, False, 2.5)
    assert (marked("a@1.5s").place, marked("a@1.5s").in_seconds, marked("a@1.5s").seconds) == (1.5, True, None)
    for text in ("a", "a@", "a@1.5", "a@-3", "@3", "a@x=1"):
        with pytest.raises(UserError, match="is written"):
            marked(text)
    with pytest.raises(ValueError, match="another skeleton"):
        ground_below(np.zeros((5, 20, 3)), "a")


@pytest.fixture(scope="module")
def matching(tmp_path_factory: pytest.TempPathFactory, built_lake: Path) -> Path:
    lake = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("keyed") / "lake"))
    with (lake / "config.toml").open("a", encoding="utf-8") as handle:
        handle.write('[synthesis]\nrecipe = "matching"\n')
    assert command("run", "synth", "--lake", lake).status == 0
    return lake


@pytest.fixture(scope="module")
def two(matching: Path) -> list[tuple[str, str, int, float]]:
    """Clip, label, frames and rate of two long labelled clips."""
    return query(
        matching,
        "SELECT clip, label, frames, fps FROM clips WHERE label IS NOT NULL AND format <> 'synthetic' "
        "ORDER BY seconds DESC, clip LIMIT 2",
    )


def stored(lake: Path, clip: str) -> Float64Array:
    """[F, 21 x 3] joints."""
    names = "COLUMNS('_[xyz]$')"
    rows = query(lake, f"SELECT {names} FROM frames WHERE clip = $clip ORDER BY frame", clip=clip)
    return np.array(rows, dtype=float)


def test_keyframes_are_the_same_in_three_ways(matching: Path, two: list[tuple[str, str, int, float]]) -> None:
    (clip, label, frames, fps), (other, *_) = two
    last = min(frames - 1, round(1.2 * fps))
    seconds = last / fps
    words = [f"{clip}@3", f"{clip}@{last}", f"{other}@2={seconds + 0.9:.3f}"]
    given_words = [word for text in words for word in ("--keyframes", text)]
    run = command("synthesize", *given_words, "--class", label, "--seed", "3", "--json", "--lake", matching)
    assert run.status == 0, run.err
    made = stored(matching, run.json["clips"][0])
    true = stored(matching, clip)
    at = round((last - 3) / fps * 30)
    np.testing.assert_allclose(made[0], true[3], atol=0.02)  # a depth sensor's bones change their length
    np.testing.assert_allclose(made[at], true[last], atol=0.08)
    with Lake(matching) as lake:
        motion = lake.synthesize(label, keyframes=words, seed=3)
        rows = lake.sql(
            "SELECT root_x, root_z FROM synthesize([$label], keyframes := $keys, seed := 3) ORDER BY frame",
            {"label": label, "keys": words},
        ).fetchall()
    np.testing.assert_allclose(motion.root, made[:, :3], atol=1e-3)
    np.testing.assert_allclose(rows, motion.root[:, [0, 2]], atol=1e-3)
    assert query(matching, "SELECT seed_start, seed_stop FROM synthetic WHERE clip = $c", c=run.json["clips"][0]) == [
        (3, 4)
    ]


def test_a_style_is_the_same_in_three_ways(matching: Path, two: list[tuple[str, str, int, float]]) -> None:
    (_, label, *_), (style, *_) = two
    words = ("--class", label, "--style-from", style, "--seconds", "2", "--seed", "5", "--dataset", "styled", "--json")
    run = command("synthesize", *words, "--lake", matching)
    assert run.status == 0, run.err
    ((config,),) = query(matching, "SELECT config FROM synthetic WHERE clip = $c", c=run.json["clips"][0])
    assert json.loads(config)["control"] == {"style": style}
    with Lake(matching) as lake:
        motion = lake.synthesize(label, seconds=2, seed=5, style=style)
        rows = lake.sql(
            "SELECT root_x FROM synthesize([$l], seconds := 2, seed := 5, style := $s) ORDER BY frame",
            {"l": label, "s": style},
        ).fetchall()
    made = stored(matching, run.json["clips"][0])
    np.testing.assert_allclose(motion.root, made[:, :3], atol=1e-3)
    np.testing.assert_allclose([row[0] for row in rows], made[:, 0], atol=1e-3)


def test_an_edit_keeps_the_rest_and_joins_it(matching: Path, two: list[tuple[str, str, int, float]]) -> None:
    (clip, _, frames, fps), (_, label, *_) = two
    first, stop = round(frames * 0.4), round(frames * 0.7)
    words = ("--edit", clip, "--from", str(first), "--to", str(stop), "--class", label, "--dataset", "edited")
    run = command("synthesize", *words, "--json", "--lake", matching)
    assert run.status == 0, run.err
    name = run.json["clips"][0]
    made, true = stored(matching, name), stored(matching, clip)
    assert len(made) == len(true) == frames
    kept = np.r_[0:first, stop:frames]
    np.testing.assert_array_equal(made[kept], true[kept])
    assert np.abs(made[first:stop] - true[first:stop]).max() > 0.02
    steps, usual = (np.abs(np.diff(rows, axis=0)).max(axis=1) for rows in (made, true))
    assert max(steps[first - 1], steps[stop - 1]) < 2 * usual.max()
    assert steps.max() < 4 * usual.max()
    assert query(matching, "SELECT start, stop, label FROM segments WHERE clip = $c", c=name) == [(first, stop, label)]
    ((fps_of, own),) = query(matching, "SELECT fps, label FROM clips WHERE clip = $c", c=name)
    assert (fps_of, own) == (pytest.approx(fps), None)
    with Lake(matching) as lake:
        motion = lake.synthesize(label, edit=clip, first=first, last=stop)
        found = lake.sql(
            "SELECT class, root_x FROM synthesize([$label], edit := $clip, first := $a, last := $b) ORDER BY frame",
            {"label": label, "clip": clip, "a": first, "b": stop},
        ).fetchall()
    np.testing.assert_allclose(motion.root, made[:, :3], atol=1e-3)
    assert [row[0] for row in found] == [label if first <= i < stop else None for i in range(frames)]


def test_a_file_with_marked_keys_becomes_a_dense_bvh(
    matching: Path, two: list[tuple[str, str, int, float]], tmp_path: Path
) -> None:
    clip, _, frames, fps = two[0]
    poses, dense = tmp_path / "poses.bvh", tmp_path / "dense.bvh"
    run = command("export", clip, "--rig", "canonical", "--out", poses, "--lake", matching)
    assert run.status == 0, run.err
    table = tmp_path / "keys.csv"
    keys = [0, round(0.4 * fps), min(frames - 1, round(1.3 * fps))]
    table.write_text("frame,seconds\n" + "".join(f"{k},{k / fps}\n" for k in keys), encoding="utf-8")
    found = []
    for marks in (table, ",".join(map(str, keys))):
        run = command("inbetween", poses, "--keys", marks, "--out", dense, "--json", "--lake", matching)
        assert run.status == 0, run.err
        found.append(dense.read_text(encoding="utf-8"))
    assert found[0] == found[1]
    assert run.json["keys"] == [round(k / fps * 30) for k in keys]
    with Lake(matching) as lake:
        motion = lake.inbetween(poses, keys)
        true, made = lake.motion(poses), lake.motion(dense)
    for own, key in zip(run.json["keys"], keys, strict=True):
        np.testing.assert_allclose(made.positions[own], true.positions[key], atol=1e-4)
    np.testing.assert_allclose(motion.positions, made.positions, atol=1e-4)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--keyframes", "CLIP@3"), "two keyframes at least"),
        (("--keyframes", "CLIP@9", "--keyframes", "CLIP@3"), "times must rise"),
        (("--keyframes", "CLIP@3", "--keyframes", "CLIP@20=0"), "times must rise"),
        (("--keyframes", "CLIP@3", "--keyframes", "CLIP@99999"), "the clip has frames 0 to"),
        (("--keyframes", "CLIP@3", "--keyframes", "OTHER@3"), "say when it comes"),
        (("--keyframes", "CLIP@3", "--keyframes", "CLIP"), "is written"),
        (("--keyframes", "CLIP@3", "--keyframes", "CLIP@20", "--path", "circle"), "leave --path out"),
        (("--keyframes", "CLIP@3", "--keyframes", "CLIP@20", "--edit", "CLIP"), "leave one out"),
        (("--keyframes", "nowhere@3", "--keyframes", "CLIP@20=1"), "no such clip"),
        (("--keyframes", "STRANGE@0", "--keyframes", "STRANGE@1"), "strange.bvh"),
        (("--edit", "CLIP"), "which frames are made anew"), (("--to", "9"), "give --edit CLIP"),
        (("--edit", "CLIP", "--from", "0", "--to", "9"), "begins after frame 0"),
        (("--edit", "CLIP", "--from", "5", "--to", "99999"), "begins after frame 0"),
        (("--edit", "CLIP", "--from", "5", "--to", "6"), "s at least"),
        (("--edit", "CLIP", "--from", "up", "--to", "9"), "neither a frame"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(
    matching: Path, two: list[tuple[str, str, int, float]], tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    strange = tmp_path / "strange.bvh"
    strange.write_text(
        "HIERARCHY\nROOT box\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\nEnd Site\n{\nOFFSET 0 1 0\n}\n"
        "}\nMOTION\nFrames: 2\nFrame Time: 0.1\n0 0 0\n0 0 1\n", encoding="utf-8",
    )  # fmt: skip
    (clip, label, *_), (other, *_) = two
    names = {"CLIP": clip, "OTHER": other, "STRANGE": str(strange)}
    given_words = []
    for word in words:
        head, sep, tail = word.partition("@")
        given_words.append(names.get(head, head) + sep + tail)
    run = command("synthesize", "--class", label, *given_words, "--lake", matching)
    assert run.status == 2, run.err
    assert said in run.err
    assert run.err.count("\n") == 1

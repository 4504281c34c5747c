"""Motion graphs: the kernels beside naive ones, graphs and walks, and whole motions out of a lake."""

from __future__ import annotations

import csv
import itertools
import json
import os
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.deep_motifs.config import TransitionsConfig
from motionlake.deep_motifs.emd import emd, ground_distances
from motionlake.deep_motifs.motion_graph import transitions as kernels
from motionlake.deep_motifs.motion_graph.blend import (
    STAY,
    Placement,
    RigPoses,
    alignment,
    assemble,
    ease,
    placed,
    poses_of,
    resampled,
    steps,
)
from motionlake.deep_motifs.motion_graph.graph import (
    GraphClip,
    Transitions,
    WalkPiece,
    build_graph,
    in_context,
    near,
    random_walk,
    summarise,
)
from motionlake.deep_motifs.motion_graph.transitions import (
    JOINTS,
    context_distances,
    paired_distance,
    squared_distances,
    window_clouds,
)
from motionlake.deep_motifs.signatures import signature
from motionlake.errors import UserError
from motionlake.formats import read_clips
from motionlake.motion.clip import SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import angle, from_axis_angle, multiply, rotate, slerp
from scipy.optimize import minimize_scalar

from tests.lakes import QUICK, Changed, motionlake, query, quick_lake
from tests.samples import deepmimic_frames, deepmimic_text

CONFIG = TransitionsConfig()
AXES = {"x": (1.0, 0, 0), "y": (0, 1.0, 0), "z": (0, 0, 1.0), "-y": (0, -1.0, 0), "-z": (0, 0, -1.0)}


def wandering(frames: int, seed: int) -> Float64Array:
    """[frames, 21, 3] a body whose joints sway slowly and which walks about and turns."""
    random = np.random.default_rng(seed)
    time = np.arange(frames)[:, None, None] / 24
    rest = random.normal(0, 0.4, (21, 3)) + np.array([0, 1, 0])
    sway = 0.15 * np.sin(2 * np.pi * (time * random.uniform(0.2, 1.2, (21, 3)) + random.uniform(0, 1, (21, 3))))
    turn = from_axis_angle(np.array(AXES["y"]), np.cumsum(random.normal(0, 4, frames)))
    path = np.cumsum(random.normal(0, 0.02, (frames, 1, 3)) * [1, 0, 1], axis=0)
    return rotate(turn[:, None], rest + sway) + path


def naive_distance(a: Float64Array, b: Float64Array) -> float:
    """Of two windows [k, 21, 3]: the least root mean square over turns, each with its best shift."""
    a, b = a[:, list(JOINTS)].reshape(-1, 3), b[:, list(JOINTS)].reshape(-1, 3)

    def apart(radians: float) -> float:
        turned = rotate(from_axis_angle(np.array(AXES["y"]), np.degrees(radians)), b)
        difference = a - turned
        difference[:, [0, 2]] -= difference[:, [0, 2]].mean(axis=0)
        return float(np.mean(np.sum(difference**2, axis=1)))

    best = min(np.linspace(-np.pi, np.pi, 73), key=apart)
    return float(np.sqrt(minimize_scalar(apart, bracket=(best - 0.1, best, best + 0.1), tol=1e-12).fun))


@given(seed=st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_window_distance_is_the_least_over_turns_and_shifts(seed: int) -> None:
    a, b = wandering(12, seed), wandering(14, seed + 1)
    left, right = window_clouds(a, 8), window_clouds(b, 8)
    assert (len(left), len(right)) == (5, 7)
    rows = np.array([0, 2, 4])
    expected = [naive_distance(a[i : i + 8], b[i + 1 : i + 9]) for i in rows]
    np.testing.assert_allclose(paired_distance(left.at(rows), right.at(rows + 1)), expected, rtol=1e-6)
    squares = squared_distances(left, right)
    np.testing.assert_allclose(np.sqrt(squares[rows, rows + 1]), expected, rtol=1e-4)


def windows_of(clips: list[Float64Array]) -> kernels.Windowed:
    return kernels.windowed(clips, [max(1, (len(c) - 16) // 4 + 1) for c in clips], 4, 8)


def naive_candidates(a: list[Float64Array], b: list[Float64Array], agree: Any, *, same: bool) -> set[tuple[int, ...]]:
    """(clip, frame, clip, frame) of every local minimum, by looking at every neighbour."""
    found: set[tuple[int, ...]] = set()
    for i, first in enumerate(a):
        for j, second in enumerate(b):
            if not agree[i, j] or (same and j < i):
                continue
            left, right = window_clouds(first, 8), window_clouds(second, 8)
            sizes = (len(left), len(right))
            pairs = [paired_distance(left.at(np.full(sizes[1], s)), right) for s in range(sizes[0])]
            matrix = np.array(pairs).reshape(sizes)
            for s, t in np.ndindex(matrix.shape):
                if same and i == j and t - s < CONFIG.min_gap:
                    continue
                around = matrix[max(0, s - 4) : s + 5, max(0, t - 4) : t + 5]
                if matrix[s, t] == around.min():
                    found.add((i, s, j, t))
    return found


@pytest.mark.parametrize("same", [True, False])
def test_candidates_are_the_local_minima(monkeypatch: pytest.MonkeyPatch, same: bool) -> None:
    monkeypatch.setattr(kernels, "TILE", 19)
    a = [wandering(n, seed) for seed, n in enumerate((40, 6, 51, 33))]
    b = a if same else [wandering(n, seed) for seed, n in enumerate((37, 45), start=10)]
    agree = np.ones((len(a), len(b)), dtype=bool)
    agree[0, 1] = agree[2, 1] = False
    left = windows_of(a)
    right = left if same else windows_of(b)
    found = kernels.candidates(left, right, agree, CONFIG, same=same)
    columns = (left.clip[found.left], left.frame[found.left], right.clip[found.right], right.frame[found.right])
    got = set(zip(*(c.tolist() for c in columns), strict=True))
    assert got == naive_candidates(a, b, agree, same=same)
    assert len(got) > 10
    for row in range(0, len(found), 7):
        i, s = left.clip[found.left[row]], left.frame[found.left[row]]
        j, t = right.clip[found.right[row]], right.frame[found.right[row]]
        assert found.distance[row] == pytest.approx(naive_distance(a[i][s : s + 8], b[j][t : t + 8]), abs=2e-6)


def test_where_and_which_way_a_clip_was_recorded_changes_no_transition() -> None:
    a, b = [wandering(90, 1)], [wandering(110, 2)]
    turn = from_axis_angle(np.array(AXES["y"]), 137.0)
    moved = [rotate(turn, b[0]) + np.array([31.0, 0.0, -12.0])]
    agree = np.ones((1, 1), dtype=bool)
    plain = kernels.candidates(windows_of(a), windows_of(b), agree, CONFIG)
    again = kernels.candidates(windows_of(a), windows_of(moved), agree, CONFIG)
    assert len(plain) > 5
    np.testing.assert_array_equal(plain.left, again.left)
    np.testing.assert_array_equal(plain.right, again.right)
    np.testing.assert_allclose(plain.distance, again.distance, atol=1.5e-6)


def test_each_word_keeps_its_nearest_of_different_clips() -> None:
    a, b = windows_of([wandering(70, s) for s in (1, 2)]), windows_of([wandering(60, s) for s in (3, 4, 5)])
    found = kernels.candidates(a, b, np.ones((2, 3), dtype=bool), CONFIG)
    kept = kernels.nearest_per_word(found, a, b, 2)
    wanted = set()
    for here, own, there, other in ((found.left, a, found.right, b), (found.right, b, found.left, a)):
        for clip in range(3):
            for word in range(20):
                rows = [r for r in range(len(found)) if own.clip[here[r]] == clip and own.word[here[r]] == word]
                best: dict[int, int] = {}
                for r in sorted(rows, key=lambda r: found.distance[r]):
                    best.setdefault(int(other.clip[there[r]]), r)
                wanted |= set(list(best.values())[:2])
    assert 0 < len(kept) < len(found)
    assert set(zip(kept.left, kept.right, strict=True)) == {(found.left[r], found.right[r]) for r in wanted}


def test_contexts_are_windows_of_words_around_both_ends() -> None:
    random = np.random.default_rng(0)
    motifs = [random.integers(0, 8, n) for n in (40, 5, 23)]
    idf, ground = random.uniform(1, 2, 8), ground_distances(random.normal(size=(8, 3)))
    ends = (np.array([0, 0, 1, 2]), np.array([0, 20, 4, 22])), (np.array([2, 2, 0, 0]), np.array([22, 9, 39, 3]))
    expected = []
    for (clip, word), (other, its) in zip(zip(*ends[0], strict=True), zip(*ends[1], strict=True), strict=True):
        sides = []
        for motif, at in ((motifs[clip], word), (motifs[other], its)):
            start = min(max(at - 6, 0), max(len(motif) - 12, 0))
            sides.append(signature(np.bincount(motif[start : start + 12], minlength=8), idf))
        expected.append(emd(sides[0], sides[1], ground))
    found = context_distances(motifs, ends, idf, ground, 12)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    np.testing.assert_array_equal(found, context_distances(motifs, ends[::-1], idf, ground, 12))


def made_transitions(rows: list[tuple[int, int, int, int]]) -> Transitions:
    table = np.array(rows, dtype=np.int64).reshape(-1, 4)
    rank = np.arange(len(rows), dtype=float)
    from_clip, from_frame, to_clip, to_frame = table.T
    return Transitions(from_clip, from_frame, to_clip, to_frame, rank, rank[::-1].copy())


CLIPS = [GraphClip(name, 20.0, 200, 4) for name in "abcd"]
# a and b lead to one another; c can be entered but not left for good; d leads to itself.
ROWS = [(0, 100, 1, 10), (1, 120, 0, 20), (1, 60, 2, 50), (3, 150, 3, 20)]


def test_the_largest_component_is_what_one_can_come_back_from() -> None:
    graph = build_graph(CLIPS, made_transitions(ROWS))
    assert graph.inner.tolist() == [True, True, False, True]
    found = summarise(graph)
    # a 24 to 100, b 14 to 120 with a point at 60; d 24 to 150 is shorter.
    assert (found.points, found.largest_points, found.largest_transitions, found.largest_clips) == (8, 5, 2, 2)
    assert found.components == 2
    assert found.largest_seconds == pytest.approx((76 + 106) / 20)
    assert summarise(build_graph(CLIPS, made_transitions([]))).largest_points == 0


def test_quantiles_take_the_nearest() -> None:
    t = made_transitions(ROWS)
    assert near(t, 0.5).distance.tolist() == [0, 1]
    assert in_context(t, 0.5).context.tolist() == [1, 0]
    assert len(near(t, 1.0)) == 4


def test_walks_stay_in_the_graph_and_depend_on_the_seed() -> None:
    random = np.random.default_rng(3)
    ends = [(random.integers(4, size=120), random.integers(190, size=120)) for _ in range(2)]
    rows = [(a, b, c, d) for a, b, c, d in np.stack([*ends[0], *ends[1]], axis=1).tolist()]
    graph = build_graph(CLIPS, made_transitions(rows))
    walks = [random_walk(graph, 1, 3000, seed) for seed in (0, 0, 1)]
    assert walks[0] == walks[1] != walks[2]
    t = graph.transitions
    for walk in walks:
        assert walk[0].start == walk[0].out == 0
        assert walk[-1].out + walk[-1].stop - walk[-1].start == 3000
        assert len(walk) > 10
        for before, piece in itertools.pairwise(walk):
            assert piece.blend == 4
            taken = piece.transition
            assert (before.clip, before.stop - 4) == (t.from_clip[taken], t.from_frame[taken])
            assert (piece.clip, piece.start) == (t.to_clip[taken], t.to_frame[taken])
            assert piece.out == before.out + before.stop - 4 - before.start
            assert piece.stop - piece.start >= 8 or piece is walk[-1]
            assert (piece.clip, piece.start) != (before.clip, before.stop - 4)


def test_a_walk_goes_back_from_where_no_transition_is_allowed() -> None:
    # From b on, only the way over c leads on; the one that leads straight to the trap must be undone.
    rows = [(0, 50, 1, 10), (1, 100, 0, 10), (0, 80, 2, 10), (2, 100, 0, 20)]
    graph = build_graph(CLIPS, made_transitions(rows))
    for seed in range(5):
        walk = random_walk(graph, 0, 1000, seed, blending=lambda pieces, transition: 4 * (transition != 1))
        assert {p.clip for p in walk} == {0, 2}
    with pytest.raises(UserError, match="every transition out of it"):
        random_walk(graph, 0, 1000, 0, blending=lambda pieces, transition: 0)


def test_walks_that_cannot_be_are_clear_errors() -> None:
    graph = build_graph(CLIPS, made_transitions(ROWS))
    with pytest.raises(UserError, match="c: no transition leads out of it"):
        random_walk(graph, 2, 1000, 0)
    with pytest.raises(UserError, match=r"ask for at least 0\.4 s"):
        random_walk(graph, 0, 7, 0)


def posed(up: str, frames: int = 30) -> RigPoses:
    """A DeepMimic humanoid, stood on another axis; two file units to a metre."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "made.txt"
        file.write_text(deepmimic_text(deepmimic_frames(frames)))
        poses = poses_of(read_clips(file)[0], "y", 1.0)
    axis, degrees = {"y": ("x", 0), "-y": ("x", 180), "z": ("x", 90), "-z": ("x", -90), "x": ("z", -90)}[up]
    turn = from_axis_angle(np.array(AXES[axis]), degrees)
    rotations = poses.rotations.copy()
    rotations[:, 0] = multiply(turn, np.ascontiguousarray(rotations[:, 0]))
    return RigPoses(poses.hierarchy, rotate(turn, poses.root), poses.shifts, rotations, poses.fps, 0.5, up)


@pytest.mark.parametrize("up", ["x", "y", "z", "-y", "-z"])
def test_alignment_undoes_a_placement_on_the_ground(up: str) -> None:
    poses = posed(up)
    shift = np.array([1.5, -2.0, 0.7])
    shift -= (shift @ np.array(AXES[up])) * np.array(AXES[up])
    moved = placed(poses, Placement(70.0, tuple(shift.tolist())))
    assert np.abs(moved.positions() - poses.positions()).max() > 0.5
    back = alignment(poses, moved)
    assert back.degrees == pytest.approx(-70.0)
    np.testing.assert_allclose(placed(moved, back).positions(), poses.positions(), atol=1e-9)
    twice = back.after(Placement(70.0, tuple(shift.tolist())), up)
    np.testing.assert_allclose([twice.degrees, *twice.shift], 0.0, atol=1e-9)


def test_alignment_is_the_best_of_all_placements() -> None:
    poses = posed("y", 40)
    a, b = poses.cut(0, 8), placed(poses.cut(17, 25), Placement(40.0, (0.3, 0.0, 1.0)))
    weights = np.linalg.norm(poses.hierarchy.offsets, axis=1)
    weights[0] = weights[1:].mean()

    def cost(place: Placement) -> float:
        return float(np.sum(weights * np.sum((a.positions() - placed(b, place).positions()) ** 2, axis=-1)))

    best = alignment(a, b)
    x, _, z = best.shift
    for degrees, dx, dz in ((1.0, 0, 0), (-1.0, 0, 0), (0, 0.01, 0), (0, -0.01, 0), (0, 0, 0.01), (0, 0, -0.01)):
        assert cost(best) < cost(Placement(best.degrees + degrees, (x + dx, 0.0, z + dz)))


def test_blends_start_at_one_pose_and_end_at_the_other() -> None:
    weights = ease(10)
    assert 0 < weights[0] < 0.05
    assert weights[-1] == 1
    assert (np.diff(weights) > 0).all()
    a = from_axis_angle(np.array(AXES["x"]), np.array([10.0, 350.0, 0.0]))
    b = from_axis_angle(np.array(AXES["x"]), np.array([50.0, 10.0, 0.0]))
    for weight, degrees in ((0.0, (10, -10, 0)), (0.25, (20, -5, 0)), (1.0, (50, 10, 0))):
        expected = from_axis_angle(np.array(AXES["x"]), np.array(degrees, float))
        np.testing.assert_allclose(angle(slerp(a, b, np.full(3, weight)), expected), 0.0, atol=1e-5)


def test_pieces_are_mixed_where_they_overlap_and_whole_elsewhere() -> None:
    poses = posed("y", 30)
    made = assemble([WalkPiece(0, 0, 12, 0), WalkPiece(0, 15, 27, 8, 4, 0)], [STAY, STAY], lambda clip: poses)
    assert len(made) == 20
    np.testing.assert_array_equal(made.root[:8], poses.root[:8])
    np.testing.assert_array_equal(made.rotations[12:], poses.rotations[19:27])
    for k, weight in enumerate((0.15625, 0.5, 0.84375, 1.0)):  # 3 t^2 - 2 t^3 at t = 1/4 to 1
        a, b = poses.root[8 + k], poses.root[15 + k]
        np.testing.assert_allclose(made.root[8 + k], a + weight * (b - a))
        whole = angle(poses.rotations[8 + k], poses.rotations[15 + k])
        np.testing.assert_allclose(angle(poses.rotations[8 + k], made.rotations[8 + k]), weight * whole, atol=1e-5)


def test_resampled_poses_pass_through_the_recorded_ones() -> None:
    poses = posed("y", 31)
    double = resampled(poses, 60.0)
    assert len(double) == 61
    np.testing.assert_allclose(double.positions()[::2], poses.positions(), atol=1e-9)
    assert (steps(double).metres <= steps(poses).metres + 1e-9).all()


def looping(cycles: int, seed: int) -> Float64Array:
    """A DeepMimic motion that does the same thing again and again, now slower and now faster."""
    random = np.random.default_rng(seed)
    parts = [deepmimic_frames(int(n)) for n in random.integers(18, 70, cycles)]
    for i, part in enumerate(parts):
        part[:, 1] = 0.5 * (i + np.linspace(0, 1, len(part)))
    return np.concatenate([part[:-1] for part in parts])


@pytest.fixture(scope="module")
def graph_lake(tmp_path_factory: pytest.TempPathFactory, scheduler: str) -> Path:
    """A lake of dances, of a body of other proportions and of a very short clip; made dances without recordings."""
    source = tmp_path_factory.mktemp("source") / "dances"
    source.mkdir()
    data = os.environ.get("MOTIONLAKE_DATA")
    if data:
        for name in ("salsa/03", "salsa/05", "salsa/10", "salsa/20", "indian/13", "martial/04"):
            shutil.copyfile(Path(data) / "cmu_dance/clips" / f"{name}.bvh", source / f"{name.replace('/', '_')}.bvh")
    else:
        for i in range(6):
            (source / f"loop_{i}.txt").write_text(deepmimic_text(looping(8, i)))
    (source / "other.txt").write_text(deepmimic_text(looping(3, 9)))
    (source / "short.txt").write_text(deepmimic_text(deepmimic_frames(5)))
    lake = quick_lake(tmp_path_factory.mktemp("lakes") / "graph")
    for words in (["ingest", source, "--licence", "CC-TEST"], ["run", "all"], ["run", "transitions"]):
        run = motionlake(*words, "--lake", lake, "--scheduler", scheduler)
        assert run.status == 0, run.err
    return lake


def composed(lake: Path, folder: Path, *more: str | int) -> tuple[SourceClip, list[dict[str, Any]], dict[str, Any]]:
    """A composed motion read back, its lineage from the CSV, and the JSON report."""
    out, lineage = folder / "out.bvh", folder / "out.csv"
    run = motionlake("compose", *more, "-o", out, "--lineage", lineage, "--lake", lake, "--json")
    assert run.status == 0, run.err
    rows = list(csv.DictReader(lineage.open(encoding="utf-8")))
    return read_clips(out)[0], rows, run.json


def any_clip(lake: Path) -> str:
    return str(query(lake, "SELECT min(clip) FROM clips")[0][0])


def source_clip(lake: Path, clip: str, folder: Path) -> SourceClip:
    file = folder / "source.bvh"
    run = motionlake("export", clip, "--lake", lake, "-o", file)
    assert run.status == 0, run.err
    return read_clips(file)[0]


def test_composed_motions_come_from_their_sources(graph_lake: Path, tmp_path: Path) -> None:
    walk = (any_clip(graph_lake), "--seconds", 40, "--no-constraint")
    motion, rows, report = composed(graph_lake, tmp_path, *walk, "--no-plant")
    made = solve(motion)
    assert len(made.positions) == report["frames"] == round(40 * motion.fps)
    assert report["rig"] == "own"
    assert json.loads(json.dumps(report["lineage"]))[-1]["out_stop"] == report["frames"]
    assert len(rows) == len(report["lineage"]) > 3
    spans = [(int(r["out_start"]), int(r["out_stop"])) for r in rows]
    blend = round(motion.fps / 3)
    assert (spans[0][0], spans[-1][1]) == (0, report["frames"])
    shared = [0, *(a[1] - b[0] for a, b in itertools.pairwise(spans)), 0]
    assert {0} < set(shared) <= {0, blend, 2 * blend, 3 * blend}
    limits: dict[str, Any] = {"metres": 0.0, "degrees": 0.0}
    for i, (row, (start, stop)) in enumerate(zip(rows, spans, strict=True)):
        assert row["licence"] == "CC-TEST"
        source = solve(source_clip(graph_lake, row["clip"], tmp_path))
        assert int(row["stop"]) - int(row["start"]) == stop - start
        first, last = shared[i], stop - start - shared[i + 1]
        turn = from_axis_angle(np.array(AXES["y"]), float(row["turn"]))
        own = source.positions[int(row["start"]) : int(row["stop"])]
        expected = rotate(turn, own) + np.array([row["x"], row["y"], row["z"]], dtype=float)
        size = np.ptp(source.positions[0, :, 1])
        np.testing.assert_allclose(made.positions[start + first : start + last], expected[first:last], atol=1e-5 * size)
        assert source.local is not None
        limits["metres"] = np.maximum(limits["metres"], largest_steps(source.positions))
        limits["degrees"] = np.maximum(limits["degrees"], angle(source.local[:-1], source.local[1:]).max(axis=0))
    # No joint jumps: neither in the world nor in its angle, in blends or elsewhere.
    assert made.local is not None
    assert (largest_steps(made.positions) <= limits["metres"] * (1 + 1e-4) + 1e-3).all()
    assert (angle(made.local[:-1], made.local[1:]).max(axis=0) <= limits["degrees"] + 2e-3).all()
    assert report["jump"] <= 1


def test_feet_are_held_by_legs_alone(graph_lake: Path, tmp_path: Path) -> None:
    walk = (any_clip(graph_lake), "--seconds", 40, "--no-constraint")
    free, rows, _ = composed(graph_lake, tmp_path, *walk, "--no-plant")
    held, held_rows, report = composed(graph_lake, tmp_path, *walk)
    assert held_rows == rows
    assert report["jump"] <= 1
    before, after = solve(free).positions, solve(held).positions
    size = np.ptp(before[0, :, 1])
    changed = np.abs(before - after).max(axis=(0, 2)) > 1e-4 * size
    moved = [name.casefold() for name, is_so in zip(free.hierarchy.joints, changed, strict=True) if is_so]
    if "MOTIONLAKE_DATA" in os.environ:  # feet of made clips do not slide where they are blended
        assert moved
    assert all(re.search("knee|shin|ankle|foot|toe", name) for name in moved)


def largest_steps(positions: Float64Array) -> Float64Array:
    return np.asarray(np.linalg.norm(np.diff(positions, axis=0), axis=-1).max(axis=0))


def test_the_seed_makes_the_walk(graph_lake: Path, tmp_path: Path) -> None:
    texts = []
    for i, seed in enumerate((4, 4, 5)):
        folder = tmp_path / str(i)
        folder.mkdir()
        composed(graph_lake, folder, "--sample", "--seconds", 12, "--seed", seed, "--no-constraint")
        texts.append((folder / "out.bvh").read_bytes())
    assert texts[0] == texts[1] != texts[2]


def test_bad_clips_are_left_out(graph_lake: Path, tmp_path: Path) -> None:
    lake = Path(shutil.copytree(graph_lake, tmp_path / "lake"))
    words = ("compose", "--sample", "--seconds", 12, "-o", tmp_path / "new.bvh", "--no-constraint", "--json")
    assert "run quality" in motionlake(*words, "--min-quality", "ok", "--lake", lake).err
    used = {row["clip"] for row in motionlake(*words, "--lake", lake).json["lineage"]}
    bad = min(used)
    with Changed(lake) as con:
        con.execute(f"CREATE OR REPLACE MACRO quality_verdict(name) AS if(name = '{bad}', 'bad', 'ok')")
    found = motionlake(*words, "--min-quality", "doubtful", "--lake", lake).json["lineage"]
    assert found
    assert bad not in {row["clip"] for row in found}
    named = [bad if word == "--sample" else word for word in words]
    run = motionlake(*named, "--min-quality", "doubtful", "--lake", lake)
    assert (run.status, "--min-quality may leave it out" in run.err) == (2, True)


def test_the_constraint_leaves_the_transitions_between_alike_contexts(graph_lake: Path) -> None:
    from motionlake.lake.catalog import reading
    from motionlake.lake.layout import open_lake
    from motionlake.retrieval.compose import graph_summary, read_graph

    lake = open_lake(graph_lake)
    with reading(lake) as con:
        free = read_graph(con, lake, "dances", constrained=False).graph.transitions
        held = read_graph(con, lake, "dances").graph.transitions
        assert graph_summary(con, lake, "dances").transitions == len(held)
    pairs, kept = (
        set(zip(t.from_clip.tolist(), t.from_frame.tolist(), t.to_clip.tolist(), t.to_frame.tolist(), strict=True))
        for t in (free, held)
    )
    assert kept < pairs
    assert held.context.max() <= np.quantile(free.context, 0.25)
    assert len(held) >= 0.25 * len(free)


def test_transitions_go_both_ways_and_keep_to_one_body(graph_lake: Path) -> None:
    rows = query(
        graph_lake, "SELECT from_clip, from_frame, to_clip, to_frame, distance, context_distance FROM transitions"
    )
    assert len(rows) > 100
    assert {(c, d, a, b, *rest) for a, b, c, d, *rest in rows} == set(rows)
    assert not any("short" in row[0] for row in rows)
    if "MOTIONLAKE_DATA" in os.environ:  # made clips are all of one body
        assert all(("other" in row[0]) == ("other" in row[2]) for row in rows)
    assert all(a != c or abs(b - d) > 20 for a, b, c, d, *_ in rows)
    lengths = dict(query(graph_lake, "SELECT clip, frames - round(fps / 3) FROM clips"))
    assert all(0 <= row[1] <= lengths[row[0]] for row in rows)
    clip = rows[0][0]
    found = query(graph_lake, "SELECT to_clip, distance FROM transitions_from($clip)", clip=clip)
    assert len(found) == sum(row[0] == clip for row in rows)
    assert [d for _, d in found] == sorted(d for _, d in found)


def test_only_what_is_missing_is_compared(graph_lake: Path, tmp_path: Path, scheduler: str) -> None:
    lake = Path(shutil.copytree(graph_lake, tmp_path / "lake"))

    def run(*words: str) -> dict[str, int]:
        made = motionlake(*words, "--lake", lake, "--scheduler", scheduler, "--json")
        assert made.status == 0, made.err
        return {row["stage"]: row["shards"] for row in made.json}

    def rows() -> list[tuple[Any, ...]]:
        return query(lake, "SELECT * EXCLUDE (context_distance) FROM transitions ORDER BY ALL")

    def due() -> int:
        stages = motionlake("status", "--lake", lake, "--json").json["stages"]
        return next(int(s["due"]) for s in stages if s["stage"] == "transitions")

    before = rows()
    assert run("run", "transitions") == {"transitions": 0}
    # New motifs compare contexts anew, and nothing else.
    (lake / "config.toml").write_text(QUICK + "seed = 1\n", encoding="utf-8")
    run("run", "motifs")
    run("run", "signatures")
    assert query(lake, "SELECT count(*) FROM transitions") == [(0,)]
    assert due() == 1
    assert run("run", "transitions", "--dataset", "dances") == {"transitions": 1}
    assert (rows(), due()) == (before, 0)
    gone = before[0][0]
    assert motionlake("remove", gone, "--lake", lake).status == 0
    left = rows()
    assert 0 < len(left) < len(before)
    assert not any(gone in (row[0], row[3]) for row in left)
    run("run", "transitions")
    assert due() == 0
    assert not any(gone in (row[0], row[3]) for row in rows())


def test_mistakes_get_one_clear_line(graph_lake: Path, built_lake: Path, tmp_path: Path) -> None:
    clip, out = any_clip(graph_lake), tmp_path / "x.bvh"
    other = query(built_lake, "SELECT min(clip) FROM clips")[0][0]
    for words, lake, said in (
        ((clip, "--seconds", 0.3), graph_lake, "ask for at least"),
        (("short",), graph_lake, "no transition leads out of it"),
        ((other,), built_lake, "motionlake run transitions --dataset"),
        ((), graph_lake, "name one clip to start with, or give --sample"),
        ((clip, "--lineage", tmp_path / "x.txt"), graph_lake, "ends in .csv or .json"),
        (("--sample", "--dataset", "nowhere"), graph_lake, "nowhere: no such dataset"),
    ):
        run = motionlake("compose", *words, "-o", out, "--lake", lake)
        assert run.status == 2, words
        assert said in run.err
        assert len(run.err.strip().splitlines()) == 1
        assert not out.exists()
    run = motionlake("run", "transitions", "--dataset", "nowhere", "--lake", graph_lake)
    assert run.status == 2
    assert "nowhere: no such dataset" in run.err

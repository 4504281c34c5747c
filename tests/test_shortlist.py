"""The search of a large lake: what the stage keeps, and that its answers are those of comparing every clip."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Collection, Container, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import motionlake as library
import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.errors import DamagedError, UserError
from motionlake.lake.catalog import reading
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake, open_lake
from motionlake.motion.dtw import clip_dtw, clip_path
from motionlake.motion.skeleton import COMMON
from motionlake.motion.sketches import Directions, Sketches, instants
from motionlake.retrieval import narrowed
from motionlake.retrieval.asked import Ranking
from motionlake.retrieval.chosen import ChosenSearcher
from motionlake.retrieval.descriptor import DescriptorSearcher
from motionlake.retrieval.fused import FusedSearcher
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.lake_shortlist import shortlist_of
from motionlake.retrieval.matched import matched_moves
from motionlake.retrieval.moves import MovesSearcher
from motionlake.retrieval.protocol import LakeSearcher, Query, Scope
from motionlake.retrieval.query_by_example import WordsSearcher
from motionlake.retrieval.registry import searcher
from motionlake.retrieval.shortlist import Most
from motionlake.retrieval.shortlist_methods import METHODS, UNIT, ByMoves
from motionlake.retrieval.submotion_search import SubmotionSearcher
from motionlake.retrieval.window_shortlist import WindowShortlist
from motionlake.stages import shortlist_moves
from motionlake.stages.moves import read_tracks
from motionlake.stages.postures import codes_of_clips
from motionlake.stages.reader import lake_reader
from motionlake.stages.shortlist import COMPARED, SHORTLIST
from motionlake.stages.shortlist_files import MOVES as PIECES
from motionlake.stages.shortlist_files import ShortlistFiles, mapped_array, write_lists
from motionlake.threads import limited

from tests.lakes import Changed, files, motionlake, query, quick_lake
from tests.test_newer_models import newer

MODULES = ("stages.graph", "stages.shortlist", "retrieval.fused", "retrieval.fused_ranges", "retrieval.lake_shortlist")
CHOOSING = ("stages.shortlist", "retrieval.lake_shortlist", "retrieval.descriptor")


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory, built_lake: Path, scheduler: str) -> Path:
    """A lake that counts as a large one, with its shortlist."""
    root = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("shortlist") / "lake"))
    with Changed(root) as con:
        con.execute("UPDATE clips SET split = if(rowid % 3 = 0, 'train', 'test')")
        con.execute("UPDATE clips SET format = 'synthetic' WHERE clip = (SELECT min(clip) FROM clips)")
    with few():
        run = motionlake("run", "shortlist", "--lake", root, "--scheduler", scheduler)
    assert run.status == 0, run.err
    return root


@contextmanager
def few() -> Iterator[None]:
    """Within the block a lake of more than three clips is a large one."""
    with middling(), pytest.MonkeyPatch.context() as patched:
        for module in MODULES:
            patched.setattr(f"motionlake.{module}.MOST", 3)
        yield


@contextmanager
def middling() -> Iterator[None]:
    """Within the block clips are chosen in a lake of more than three; it has a neighbour graph."""
    with pytest.MonkeyPatch.context() as patched:
        for module in CHOOSING:
            patched.setattr(f"motionlake.{module}.WHOLE", 3)
        yield


def some(root: Path, count: int) -> list[str]:
    text = "SELECT clip FROM symbol_strings JOIN signatures USING (clip) WHERE len(symbols) > 3 ORDER BY clip"
    return [row[0] for row in query(root, text)][:count]


def both(root: Path, asked: Query, k: int, scope: Scope, *, explain: bool = False) -> tuple[list[Hit], list[Hit]]:
    """Answers by the shortlist, and by comparing every clip."""
    with few():
        search = FusedSearcher(open_lake(root), graph=False, explain=explain)
        assert search._cascade is not None
        (ours,) = search.search([asked], k, scope)
    (exact,) = exactly(root, explain=explain).search([asked], k, scope)
    return ours, exact


def held(answers: Iterable[tuple[list[Hit], list[Hit]]]) -> float:
    """The mean share of exact answers that are answers by the shortlist."""
    shares = [len({hit.clip for hit in ours} & {hit.clip for hit in exact}) / len(exact) for ours, exact in answers]
    return float(np.mean(shares))


def exactly(root: Path, *, explain: bool = False) -> FusedSearcher:
    lake = open_lake(root)
    methods = {name: cast(LakeSearcher, searcher("clip", name, lake)) for name in COMPARED}
    return FusedSearcher(lake, searchers=methods, graph=False, explain=explain)


def as_near_mirrored(root: Path, asked: Query) -> set[str]:
    """Clips as near as their mirror images, but for rounding: either may be the answer."""
    seen = [exactly(root).nearest([asked], 1000, Scope(), mirrored=mirrored)[0] for mirrored in (False, True)]
    plain, turned = ({hit.clip: hit.distance for hit in hits} for hits in seen)
    return {clip for clip in plain.keys() & turned.keys() if abs(plain[clip] - turned[clip]) < 4e-4}


def assert_alike(ours: list[Hit], exact: list[Hit], either: Collection[str] = ()) -> None:
    def shown(hit: Hit) -> Hit:
        return replace(hit, rank=0, distance=0.0, shares=None, mirrored=hit.mirrored and hit.clip not in either)

    assert [hit.distance for hit in ours] == pytest.approx([hit.distance for hit in exact], abs=2e-4)
    expected = {hit.clip: hit for hit in exact}
    assert {hit.clip for hit in ours} == set(expected)
    assert [shown(hit) for hit in ours] == [shown(expected[hit.clip]) for hit in ours]


def test_answers_are_those_of_comparing_every_clip(large: Path, clips_folder: Path) -> None:
    """Of a small lake all clips are chosen; a clip, a part of one, a file, and each of them mirrored."""
    clip, other = some(large, 2)
    either = as_near_mirrored(large, Query(clip))
    if "MOTIONLAKE_DATA" in os.environ:  # sides of made clips move alike
        assert len(either) < 6
    for scope in (
        Scope(), Scope(mirrored=True), Scope(split="train"), Scope(recorded_only=True), Scope(own=True), Scope("none"),
    ):  # fmt: skip
        ours, exact = both(large, Query(clip), 1000, scope)
        assert_alike(ours, exact, either)
        assert bool(ours) == (scope.dataset is None)
    ((frames,),) = query(large, "SELECT frames FROM clips WHERE clip = $clip", clip=other)
    assert_alike(*both(large, Query(other, 0, frames // 2), 5, Scope()))
    assert_alike(*both(large, Query(clips_folder / other.partition("/")[2]), 5, Scope()))
    with few(), pytest.raises(UserError, match="nobody"):
        FusedSearcher(open_lake(large)).search([Query("clips/nobody.bvh")], 3)


def test_few_chosen_clips_hold_the_nearest(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motionlake.retrieval.shortlist.LARGE", Most(12, 6))
    monkeypatch.setattr("motionlake.retrieval.shortlist_methods.UNIT", 12)
    monkeypatch.setattr("motionlake.retrieval.fused.REACH", 5)
    assert held(both(large, Query(clip), 3, Scope()) for clip in some(large, 99)) > 0.9
    with few():
        (hits,) = FusedSearcher(open_lake(large)).search([Query(some(large, 1)[0])], 1000)
    assert len(hits) > 12, "who asks for more gets more"


def test_likeness_is_of_distances_of_vectors(large: Path) -> None:
    """A half at the clip that is the scale of others, nearly 1 at the clip, and 0 where a method knows nothing."""
    with few(), reading(open_lake(large)) as con:
        files = ShortlistFiles.open(open_lake(large), shortlist_of(open_lake(large)))
        for name, kind in METHODS.items():
            method = kind(open_lake(large), files, con)
            clip, kept = some(large, 1)[0], files.sketches(name)
            vectors, known = kept.places * kept.steps, np.isfinite(kept.norms)
            row = files.table["clip"].to_pylist().index(clip)
            asked = files.directions(name).project(method.sketch(method.of_row(row)))
            apart = np.linalg.norm(vectors - asked, axis=1)
            halves = 1e-3  # moves are kept in half precision, and were projected before
            assert apart[row] <= np.linalg.norm(kept.steps) / 2 + halves, "rounded to whole steps"
            scale = np.sort(apart[known])[min(UNIT, known.sum()) - 1]
            found = method.likeness(method.of_row(row))
            assert not found[~known].any()
            told = 1 / found[known] - 1
            # Squares of distances are told by those of lengths: of clips that are nearly the same little is left.
            np.testing.assert_allclose(told**2, (apart[known] / scale) ** 2, rtol=2e-3, atol=5e-4)
            assert found[row] > 0.99, "nearer than single precision tells"


def test_a_long_query_is_aligned_with_fewer_clips(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the likeliest, so many that their symbols and those of the query make no more pairs than are afforded."""
    monkeypatch.setattr("motionlake.retrieval.shortlist_methods.FEWEST", 4)
    with few():
        search = FusedSearcher(open_lake(large), graph=False)
        assert search._cascade is not None
        methods, files = search._cascade._methods, search._cascade.files
        lengths = files.joined("symbols", np.arange(len(files.table)))[1]
        for clip in some(large, 5):
            row = search._cascade._clips.row(clip)
            of = {name: method.of_row(row) for name, method in methods.items()}
            order = np.argsort(-sum(methods[name].likeness(of[name]) for name in methods), kind="stable")[:12]
            symbols = len(of["alignment"])
            for enough in (1, 7, 12):
                cells = symbols * int(lengths[order[:enough]].sum())
                monkeypatch.setattr("motionlake.retrieval.shortlist.LARGE", Most(12, 6, cells))
                asked = search._cascade.nearest(Query(clip), 12, Scope(), mirrored=False, failed=[])
                assert len(asked.by["alignment"].clips) == 12, "as many as are asked for"
                aligned = order[: max(4, enough)]
                asked = search._cascade.nearest(Query(clip), len(aligned), Scope(), mirrored=False, failed=[])
                assert set(asked.by["alignment"].clips) == set(aligned.tolist())


def test_nearest_reach_as_far_as_of_all_clips(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By signatures as many of the chosen clips count as are among the k nearest of all by vectors; by moves about how
    far the clip at that place is, as much farther as others are in full."""
    k = 6
    monkeypatch.setattr("motionlake.retrieval.shortlist.LARGE", Most(8, 5))
    monkeypatch.setattr("motionlake.retrieval.shortlist_methods.UNIT", 12)
    with few():
        search = FusedSearcher(open_lake(large), graph=False)
        assert search._cascade is not None
        methods, signatures = search._cascade._methods, 0
        for clip in some(large, 99):
            asked = search._cascade.nearest(Query(clip), k, Scope(), mirrored=False, failed=[])
            row, every = search._cascade._clips.row(clip), np.arange(len(search._cascade.files.table))
            of = {name: methods[name].of_row(row) for name in methods}
            total = sum(methods[name].likeness(of[name]) for name in methods)
            chosen = np.sort(np.argsort(-total, kind="stable")[:8])

            near = methods["signature"].likeness(of["signature"])
            there = int((near[chosen] >= np.sort(near)[-k]).sum())
            _, distances = methods["signature"].among(of["signature"], chosen, 99)
            assert asked.by["signature"].reach == np.sort(distances)[min(max(1, there), k) - 1]
            signatures += there < k

            by_moves = cast(ByMoves, methods["moves"])
            rows, rough = by_moves.roughly(of["moves"], chosen)
            found, distances = by_moves.among(of["moves"], every, 999)
            compared = dict(zip(found.tolist(), distances.tolist(), strict=True))
            ranking = asked.by["moves"]
            assert len(ranking.clips) == 5
            assert ranking.distances.tolist() == pytest.approx([compared[clip] for clip in ranking.clips], abs=1e-5)
            about = dict(zip(rows.tolist(), rough.tolist(), strict=True))
            ratios = [compared[clip] / max(about[clip], 1e-6) for clip in ranking.clips]
            assert ranking.reach == pytest.approx(np.median(ratios) * np.sort(rough)[k], rel=1e-4)
    assert signatures, "some of the nearest were not chosen, or nothing was looked at"


@pytest.fixture(scope="module")
def middle(tmp_path_factory: pytest.TempPathFactory, built_lake: Path, scheduler: str) -> Path:
    """A lake whose shortlist stands beside its neighbour graph."""
    root = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("middle") / "lake"))
    with middling():
        run = motionlake("run", "shortlist", "--lake", root, "--scheduler", scheduler)
    assert run.status == 0, run.err
    return root


def test_a_lake_of_middle_size_goes_along_its_graph(middle: Path, clips_folder: Path) -> None:
    """By every method, with the graph: as in a lake whose clips are all compared; of one this small all are chosen."""
    lake = open_lake(middle)
    (clip, _, _), (other, frames, _) = longest(middle, 2)
    either = as_near_mirrored(middle, Query(clip))
    for scope in (Scope(), Scope(mirrored=True), Scope(own=True)):
        for asked in (Query(clip), Query(other, 0, int(0.8 * frames)), Query(clips_folder / other.partition("/")[2])):
            with middling():
                search = FusedSearcher(lake, explain=True)
                assert search._cascade is not None
                (ours,) = search.search([asked], 6, scope)
            (exact,) = FusedSearcher(lake, explain=True).search([asked], 6, scope)
            assert_alike(ours, exact, either)
            shown = [{share.method: share.along for share in hit.shares or ()} for hit in (ours[-1], exact[-1])]
            assert shown[0] == pytest.approx(shown[1], abs=2e-3)
            assert {"signature", "alignment", "moves", "descriptor", "together"} == set(shown[0])
            assert any(share.along for hit in ours for share in hit.shares or ())
    (exact,) = FusedSearcher(lake, graph=False).search([Query(clip)], 6, Scope())
    with middling():
        (ours,) = FusedSearcher(lake, graph=False).search([Query(clip)], 6, Scope())
        every = FusedSearcher(lake, graph=False, exact=True)
        assert every._cascade is None
        assert every.search([Query(clip)], 6, Scope()) == [exact]
    assert_alike(ours, exact)


def test_of_a_lake_of_middle_size_some_clips_are_chosen(middle: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motionlake.retrieval.shortlist.MIDDLE", Most(12, 6))
    monkeypatch.setattr("motionlake.retrieval.shortlist_methods.UNIT", 12)
    monkeypatch.setattr("motionlake.retrieval.fused.REACH", 8)
    asked = [Query(clip) for clip in some(middle, 20)]
    exact = FusedSearcher(open_lake(middle)).search(asked, 3)
    with middling():
        ours = FusedSearcher(open_lake(middle)).search(asked, 3)
    assert held(zip(ours, exact, strict=True)) > 0.8


def test_pieces_of_a_lake_of_middle_size_are_looked_for_in_all_clips(middle: Path) -> None:
    """Its shortlist holds nothing of windows, postures and joints, and `find` asks it for words alone."""
    with middling():
        kept = shortlist_of(open_lake(middle))
        assert kept
        assert not any("windows" in file or file.endswith((".codes", ".joints")) for file in kept)
        assert shortlist_of(open_lake(middle), "range") == []
        kinds = {name: type(searcher("range", name, open_lake(middle))).__name__ for name in ("alignment", "moves")}
    assert kinds == {"alignment": "AlignmentRangeSearcher", "moves": "NearMovesSearcher"}
    (clip, frames, fps), _ = longest(middle, 2)
    asked = Query(clip, int(0.1 * fps), min(frames, int(1.4 * fps)))
    for method in ("words", "fused"):
        exact = searcher("range", method, open_lake(middle)).search([asked], 5)
        with middling():
            search = searcher("range", method, open_lake(middle))
            assert method == "fused" or cast(WordsSearcher, search).large is not None
            assert search.search([asked], 5) == exact


def test_a_lake_grows_from_middle_size_to_large(middle: Path, tmp_path: Path, scheduler: str) -> None:
    """Its shortlist is made with all that a large one holds, and back."""
    root = Path(shutil.copytree(middle, tmp_path / "lake"))
    before = shortlist_of_all(root)
    for size in (few, middling):
        with size():
            run = motionlake("run", "shortlist", "--lake", root, "--scheduler", scheduler)
            assert run.status == 0, run.err
            found = shortlist_of(open_lake(root))
            assert any("windows" in file for file in found) == (size is few)
            (hits,) = FusedSearcher(open_lake(root), graph=False).search([Query(some(root, 1)[0])], 5)
            assert len(hits) == 5
    assert shortlist_of_all(root) == before


def shortlist_of_all(root: Path) -> dict[str, bytes]:
    with middling():
        return {Path(file).name: (root / file).read_bytes() for file in shortlist_of(open_lake(root))}


def test_what_lies_beyond_the_reach_is_as_near_as_the_last(large: Path) -> None:
    with few():
        search = FusedSearcher(open_lake(large), graph=False)
    distances = np.array([0.1, 0.2, 0.3, 0.4])
    view = search._view("signature", Ranking([5, 6, 7, 8], distances, 0.25), None, set())
    near = search._view("signature", Ranking([5, 6, 7, 8], distances), None, set()).near
    assert view.near.tolist()[:2] == near.tolist()[:2]
    assert near[2] < view.near[2] == view.near[3] < near[1]


def longest(root: Path, count: int) -> list[tuple[str, int, float]]:
    """Clip, frames and rate of those that last longest."""
    text = "SELECT clip, frames, fps FROM clips JOIN symbol_strings USING (clip) JOIN signatures USING (clip)"
    return query(root, f"{text} WHERE len(symbols) > 3 ORDER BY frames / fps DESC, clip LIMIT {count:d}")


def of_some_and_all(lake: Path, method: str, asked: Query, scope: Scope, k: int = 5) -> tuple[list[Hit], list[Hit]]:
    """Answers inside clips of a large lake, and those of comparing it whole."""
    with few():
        (ours,) = searcher("range", method, open_lake(lake)).search([asked], k, scope)
    (exact,) = searcher("range", method, open_lake(lake), exact=True).search([asked], k, scope)
    return ours, exact


def assert_as_near(ours: list[Hit], every: list[Hit], k: int) -> None:
    """Clips that are about as far may stand in for one another: moves of a large lake are of half precision."""
    assert [hit.distance for hit in ours] == pytest.approx([hit.distance for hit in every[:k]], abs=2e-4)
    known = {hit.clip: hit.distance for hit in every}
    assert [hit.distance for hit in ours] == pytest.approx([known[hit.clip] for hit in ours], abs=2e-4)


SCOPES = (Scope(), Scope(own=True), Scope(mirrored=True), Scope(split="train"), Scope("none"), Scope(below=0.4))


@pytest.mark.parametrize("scope", SCOPES, ids=str)
@pytest.mark.parametrize("method", ["words", "fused"])
def test_pieces_are_found_as_in_a_small_lake(large: Path, clips_folder: Path, method: str, scope: Scope) -> None:
    """A part of a clip, a clip and a file; of a large lake "fused" is "words"."""
    (clip, frames, fps), (other, many, _) = longest(large, 2)
    part = Query(clip, int(0.1 * fps), min(frames, int(1.4 * fps)))
    for asked in (part, Query(clip), Query(clips_folder / other.partition("/")[2], 0, int(0.8 * many))):
        with few():
            (ours,) = searcher("range", method, open_lake(large)).search([asked], 5, scope)
        (exact,) = searcher("range", "words", open_lake(large)).search([asked], 5, scope)
        assert ours == exact


def assert_rows_are_those_of_parts(root: Path) -> None:
    lake = open_lake(root)
    opened = ShortlistFiles.open(lake, [str(path.relative_to(root)) for path in root.glob("shortlist/*")])
    names, parts = (opened.table[name].to_pylist() for name in ("clip", "part"))
    with reading(lake) as con:
        codes = codes_of_clips(con, lake, opened.models["alignment"], names)
    tracks = read_tracks(lake, dict(zip(names, parts, strict=True)))
    for held, wanted in ((opened.postures, codes), (opened.joints, {clip: tracks.joints(clip) for clip in tracks})):
        assert held is not None
        assert wanted
        for clip, rows in zip(names, held.of(np.arange(len(names))), strict=True):
            np.testing.assert_array_equal(rows, wanted.get(clip, rows[:0]))


@pytest.mark.parametrize(
    ("method", "read"),
    [("alignment", "retrieval.symbol_strings.codes_of_clips"), ("moves", "stages.moves.read_tracks")],
)
def test_answers_are_told_by_the_shortlist(
    large: Path, method: str, read: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The postures and joints in it are those of parts, which a search does not read."""
    assert_rows_are_those_of_parts(large)
    ((clip, frames, fps),) = longest(large, 1)
    asked = Query(clip, 0, min(frames, int(1.5 * fps)))
    (wanted, _) = of_some_and_all(large, method, asked, Scope())
    monkeypatch.setattr(f"motionlake.{read}", None)
    with few():
        assert searcher("range", method, open_lake(large)).search([asked], 5) == [wanted]


@pytest.mark.parametrize("method", ["alignment", "moves"])
def test_a_shortlist_without_rows_of_parts_serves_too(
    large: Path, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An earlier version made it: postures and joints are read from parts."""
    ((clip, frames, fps),) = longest(large, 1)
    asked, own = Query(clip, 0, min(frames, int(1.5 * fps))), ShortlistFiles.open
    (wanted, _) = of_some_and_all(large, method, asked, Scope())

    def without(lake: Lake, *given: Any) -> ShortlistFiles:
        opened = own(lake, *given)
        return replace(opened, table=opened.table.drop_columns(["postures_piece", "joints_piece"]))

    monkeypatch.setattr(ShortlistFiles, "open", staticmethod(without))
    assert of_some_and_all(large, method, asked, Scope())[0] == wanted


@pytest.mark.parametrize("method", ["alignment", "moves"])
def test_pieces_in_the_clips_that_hold_what_is_like_them(
    large: Path, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of all clips the answers are those of comparing the lake; of a few, answers are of these and of the query's."""
    ((clip, frames, fps),) = longest(large, 1)
    asked = Query(clip, 0, min(frames, int(1.5 * fps)))
    for scope in (Scope(), Scope(own=True), Scope(mirrored=True), Scope(split="train")):
        ours, exact = of_some_and_all(large, method, asked, scope)
        assert ours == exact
    monkeypatch.setitem(narrowed.CLIPS, method, 3)
    ours, _ = of_some_and_all(large, method, asked, Scope(own=True), 3)
    nearest = {hit.clip for hit in ours if hit.distance == ours[0].distance}
    assert clip in nearest, "beside others where made clips have the same symbols"
    assert len({hit.clip for hit in ours}) <= 4
    with few():
        by = searcher("range", method, open_lake(large))
        assert isinstance(by, narrowed.NarrowedSearcher)
        near = by.distances([asked], [asked, Query(clip)])
        assert near.shape == (1, 2)
        assert near[0, 0] == pytest.approx(0, abs=1e-4)
        with pytest.raises(UserError, match=r"too short|at least"):
            by.search([Query(clip, 0, int(0.25 * fps))], 3)


def test_windows_tell_in_which_clips_moves_are_looked_for(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also for a piece that has no two words; without windows in the shortlist words tell."""
    ((clip, _, fps),) = longest(large, 1)
    short, asked = Query(clip, 0, int(0.45 * fps)), Query(clip, 0, int(1.5 * fps))
    ours, exact = of_some_and_all(large, "moves", short, Scope())
    assert ours == exact
    with few():
        by = searcher("range", "moves", open_lake(large))
        submotion = searcher("range", "submotion", open_lake(large))
    assert isinstance(submotion, SubmotionSearcher)
    monkeypatch.setitem(narrowed.CLIPS, "moves", 8)
    ((hits,), (wanted,)) = (each.search([asked], 8, Scope(own=True)) for each in (by, submotion))
    assert len(hits) > 1, "clips that are shorter than the piece are no answers by moves"
    assert {hit.clip for hit in hits} <= {hit.clip for hit in wanted}
    monkeypatch.setattr(WindowShortlist, "open", lambda *_: None)
    with few():
        by = searcher("range", "moves", open_lake(large))
        assert by.search([asked], 4, Scope(own=True))[0][0].clip == clip
        with pytest.raises(UserError, match="at least"):
            by.search([short], 3)


@pytest.mark.parametrize("method", ["signature", "alignment", "moves"])
def test_one_method_alone(large: Path, clips_folder: Path, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Answers are those of comparing every clip, of a clip, a part of one, a file, and each of them mirrored."""
    (clip, _, _), (other, frames, _) = longest(large, 2)
    exact = cast(LakeSearcher, searcher("clip", method, open_lake(large), exact=True))
    with few():
        by = searcher("clip", method, open_lake(large))
        assert isinstance(by, ChosenSearcher)
        assert by.name == method
    asked = [Query(clip), Query(other, 0, int(0.8 * frames)), Query(clips_folder / other.partition("/")[2])]
    for scope in (Scope(), Scope(own=True), Scope(split="train"), Scope(recorded_only=True), Scope("none")):
        for each in asked:
            assert_as_near(by.search([each], 5, scope)[0], exact.search([each], 1000, scope)[0], 5)
    with few(), library.open_lake(large) as opened, monkeypatch.context() as patch:
        patch.setattr(ChosenSearcher, "search", None)
        (right,) = exact.search(asked[:1], 1000)
        rows = opened.search(clip, 1000, method=method, exact=True)
        assert [row["clip"] for row in rows] == [hit.clip for hit in right]
        with pytest.raises(TypeError):
            opened.search(clip, 1000, method=method)
    turned = Scope(mirrored=True)
    (right,) = exact.search(asked[:1], 1000, turned)
    assert_as_near(by.search(asked[:1], 1000, turned)[0], right, 1000)
    assert np.array_equal(by.distances(asked[:1], asked), exact.distances(asked[:1], asked))
    assert set(by.matches(asked[0], right[:2], mirrored=False)) == set(
        exact.matches(asked[0], right[:2], mirrored=False)
    )
    monkeypatch.setattr(METHODS[method], "chosen", 8)
    monkeypatch.setattr("motionlake.retrieval.shortlist.ALONE_IN_FULL", 4)
    found = []
    for name in some(large, 99):
        (ours,), (right,) = by.search([Query(name)], 2), exact.search([Query(name)], 2)
        found.append(len({hit.clip for hit in ours} & {hit.clip for hit in right}) / 2)
    assert np.mean(found) > 0.85


def test_the_catalog_answers_the_first_queries_by_descriptor(large: Path, clips_folder: Path) -> None:
    """To the last bit; then all descriptors are read."""
    (clip, _, _), (other, frames, _) = longest(large, 2)
    lake = open_lake(large)
    exact = searcher("clip", "descriptor", lake)
    asked = [Query(clip), Query(other, 0, frames // 2), Query(clips_folder / other.partition("/")[2])]
    for scope in (
        Scope(),
        Scope(own=True),
        Scope(mirrored=True),
        Scope(split="train"),
        Scope("none"),
        Scope(below=0.5),
    ):
        for k in (3, 1000):
            with few():
                by = DescriptorSearcher(lake)
                assert by.search(asked[:1], k, scope) == exact.search(asked[:1], k, scope)
                assert by.search(asked[1:], k, scope) == exact.search(asked[1:], k, scope)
    with few():
        by = DescriptorSearcher(lake)
        for _ in range(5):
            assert "_all" not in vars(by) or not by._by_catalog
            assert by.search(asked[:1], 4) == exact.search(asked[:1], 4)
        assert "_all" in vars(by)
        by = DescriptorSearcher(lake)
        assert by.search(asked * 3, 4) == exact.search(asked * 3, 4)
        assert not by._by_catalog, "all were read for so many at once"
        with pytest.raises(UserError, match="nobody"):
            DescriptorSearcher(lake).search([Query("clips/nobody.bvh")], 3)


def test_every_clip_is_compared_where_that_is_asked_for(large: Path, built_lake: Path) -> None:
    clip = some(large, 1)[0]
    with (
        few(),
        pytest.raises(UserError, match="too large"),
    ):  # without a shortlist too, where signatures alone are asked
        FusedSearcher(open_lake(built_lake), exact=True)
    asked = ("--method", "alignment", "--exact", "--lake", large, "--json")
    with few():
        run = motionlake("search", clip, *asked)
        assert run.status == 0
        assert motionlake("find", clip, *asked).status == 0
        for command, method, told in (
            ("search", "fused", "too large"), ("search", "descriptor", "fused, signature, alignment, moves"),
            ("find", "words", "alignment, submotion, moves"),
        ):  # fmt: skip
            run = motionlake(command, clip, "--method", method, "--exact", "--lake", large)
            assert (run.status, told in run.err, len(run.err.splitlines())) == (2, True, 1)


def test_a_shortlist_without_words_is_made_anew(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As earlier versions made it."""
    own = ShortlistFiles.open

    def without(lake: Lake, *given: Any) -> ShortlistFiles:
        opened = own(lake, *given)
        return replace(opened, files=[file for file in opened.files if "-words-" not in file])

    monkeypatch.setattr(ShortlistFiles, "open", staticmethod(without))
    with few(), pytest.raises(UserError, match="run shortlist"):
        searcher("range", "words", open_lake(large))


def answers(root: Path, method: str, asked: Query) -> list[Hit]:
    with few():
        return searcher("clip", method, open_lake(root)).search([asked], 5)[0]


def test_lists_in_the_table_of_clips_serve_too(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As an earlier version kept them."""
    own, asked = ShortlistFiles.open, Query(some(large, 1)[0])
    wanted = [answers(large, method, asked) for method in METHODS]

    def before(lake: Lake, names: list[str], needed: Any = ()) -> ShortlistFiles:
        opened = own(lake, names)
        table = opened.table
        for name in ("motifs", "weights", "symbols"):
            values, starts = opened.flat(name)
            held = values.astype(np.int32) if values.dtype == np.uint16 else values
            lists = pa.ListArray.from_arrays(pa.array(starts.astype(np.int32)), pa.array(held))
            table = table.append_column(name, lists)
        kept = [file for file in names if not file.endswith(("-values.npy", "-starts.npy"))]
        return replace(opened, table=table, files=kept)

    monkeypatch.setattr(ShortlistFiles, "open", staticmethod(before))
    assert [answers(large, method, asked) for method in METHODS] == wanted


def test_a_search_reads_the_arrays_of_its_methods_alone(large: Path, tmp_path: Path) -> None:
    lake = Path(shutil.copytree(large, tmp_path / "lake"))
    (words,) = lake.glob("shortlist/*-words-values.npy")
    words.write_bytes(words.read_bytes()[:-1] + b"?")
    asked = Query(some(lake, 1)[0])
    for method in (*METHODS, "fused"):
        assert answers(lake, method, asked)
    with few(), pytest.raises(DamagedError, match=r"words-values\.npy: holds other bytes"):
        searcher("range", "words", open_lake(lake))


@pytest.mark.parametrize(("values", "kind"), [([3, 65_535], "u2"), ([3, 65_536], "i4"), ([-1, 2], "i4"), ([], "u2")])
def test_lists_are_kept_in_few_bytes(tmp_path: Path, values: list[int], kind: str) -> None:
    lake, given = open_lake(quick_lake(tmp_path / "lake")), np.array(values, dtype=np.int32)
    files = write_lists(lake, "0" * 64, np.array([0, len(values)]), {"some": given})
    found, starts = (np.load(lake.path(file)) for file in files)
    assert (found.tolist(), starts.tolist(), found.dtype) == (values, [0, 0, len(values)], np.dtype(kind))


def test_moves_lie_where_they_are_said_to(large: Path) -> None:
    names = [str(path.relative_to(large)) for path in large.glob("shortlist/*")]
    shortlist = ShortlistFiles.open(open_lake(large), names)
    rows = np.array([3, 0, 5, 2])
    pieces, *places = shortlist.moves.where(rows)
    for moves, piece, start, count in zip(shortlist.moves.of(rows), *places, strict=True):
        assert len(moves) == count
        assert np.array_equal(pieces[piece][start : start + count], moves)


def test_searches_at_once_answer_as_one_after_another(large: Path) -> None:
    """By one searcher, from its first search on; to the last bit with linear algebra of one thread, as in a service."""
    asked = [Query(clip) for clip in some(large, 8)] * 3
    with few():
        (one, alone, together), scope = (FusedSearcher(open_lake(large)) for _ in range(3)), Scope()
        assert all(one.beside_others(query, scope) for query in asked)
        expected = [alone.search([query], 5)[0] for query in asked]
        with limited(1), ThreadPoolExecutor(4) as pool:
            found = list(pool.map(lambda query: together.search([query], 5)[0], asked))
    assert found == expected
    for other in (Query(large / "a.bvh"), replace(asked[0], start=3)):
        assert not one.beside_others(other, scope)
    assert not one.beside_others(asked[0], Scope(mirrored=True))
    assert not FusedSearcher(open_lake(large)).beside_others(asked[0], scope), "searchers of small lakes remember"


def test_arrays_are_opened_one_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load, within, most = np.load, [0], [0]

    def counted(*given: Any, **named: Any) -> Any:
        within[0] += 1
        most[0] = max(most[0], within[0])
        time.sleep(0.01)
        within[0] -= 1
        return load(*given, **named)

    paths = [tmp_path / f"{number}.npy" for number in range(8)]
    for number, path in enumerate(paths):
        np.save(path, np.full(3, number))
    monkeypatch.setattr(np, "load", counted)
    with ThreadPoolExecutor(4) as pool:
        assert [array[0] for array in pool.map(mapped_array, paths)] == list(range(8))
    assert most == [1]


def test_what_is_alike_is_told(large: Path) -> None:
    clip = some(large, 1)[0]
    ours, exact = both(large, Query(clip), 3, Scope(), explain=True)
    by_moves = MovesSearcher(open_lake(large))
    for hit in ours:
        known = {share.method: share.match for each in exact if each.clip == hit.clip for share in each.shares or ()}
        for share in hit.shares or ():
            if share.method != "moves":
                assert share.match is None
                continue
            assert share.match is not None
            told = known["moves"]
            assert told is not None
            assert dict(share.match.joints) == pytest.approx(dict(told.joints), abs=1e-3)
            assert set(share.match.joints) == set(COMMON)
            assert list(share.match.joints.values()) == sorted(share.match.joints.values())
            ends = share.match.path[0], share.match.path[-1]
            frames = dict(query(large, "SELECT clip, frames FROM clips"))
            assert (ends[0].query[0], ends[0].clip[0]) == (0, 0)
            assert (ends[1].query[1], ends[1].clip[1]) == (frames[clip], frames[hit.clip])
    assert by_moves.matches(Query(clip), [], mirrored=False) == {}
    with few():
        said = motionlake("search", clip, "-k", 2, "--explain", "--lake", large).out
    assert "most alike" in said


def test_a_large_lake_of_which_clips_leave(large: Path, tmp_path: Path, scheduler: str) -> None:
    """What left is no answer; the stage is due, and its files replace those of before, but for the moves."""
    root = Path(shutil.copytree(large, tmp_path / "lake"))
    gone, clip = some(root, 2)
    before = {name for name in files(root) if name.startswith("shortlist/")}
    assert motionlake("remove", gone, "--lake", root).status == 0
    with few():
        (hits,) = FusedSearcher(open_lake(root)).search([Query(clip)], 1000)
        assert gone not in {hit.clip for hit in hits}
        with pytest.raises(UserError, match=r"no clip|no such"):
            FusedSearcher(open_lake(root)).search([Query(gone)], 3)
        assert motionlake("run", "shortlist", "--lake", root, "--scheduler", scheduler).status == 0
    after = {name for name in files(root) if name.startswith("shortlist/")}
    assert len(after) == len(before)
    assert {name.partition("-")[2] for name in after & before} == {
        "moves.f16",
        "postures.codes",
        "joints.joints",
        "windows.rows",
    }
    assert_rows_are_those_of_parts(root)
    assert_alike(*both(root, Query(clip), 5, Scope()))
    assert motionlake("verify", "--deep", "--lake", root).status == 0


def test_moves_of_clips_that_come_are_added(
    large: Path, clips_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two nights the moves of new clips alone are read; they make one piece, and answers are those of all clips."""
    root, clip = Path(shutil.copytree(large, tmp_path / "lake")), some(large, 1)[0]
    sources = [clips_folder / name.partition("/")[2] for name in some(large, 4)]
    with Changed(root) as con:
        con.execute("UPDATE clips SET format = (SELECT max(format) FROM clips WHERE format <> 'synthetic')")
    (first,) = pieces(root)
    read = moves_read(monkeypatch)
    for night, source in enumerate(sources[:2], 1):
        assert motionlake("ingest", source, "--dataset", f"night{night}", "--lake", root).status == 0
        read.clear()
        with few():
            assert motionlake("run", "all", "--lake", root).status == 0
        assert len(read) == 1
        assert [path.name.partition("-")[2] for path in pieces(root)] == ["moves.f16", "moves-1.f16"]
        assert pieces(root)[0] == first
        assert_rows_are_those_of_parts(root)
    assert motionlake("verify", "--deep", "--lake", root).status == 0
    new = [row[0] for row in query(root, "SELECT clip FROM clips WHERE dataset LIKE 'night%' ORDER BY clip")]
    for asked in (clip, *new):
        assert_alike(*both(root, Query(asked), 5, Scope()), as_near_mirrored(root, Query(asked)))
    with few():
        assert motionlake("compact", "--lake", root).status == 0
        read.clear()
        assert motionlake("ingest", sources[2], "--dataset", "night3", "--lake", root).status == 0
        assert motionlake("run", "all", "--lake", root).status == 0
    assert len(read) == 1, "after parts were merged, too"
    assert_alike(*both(root, Query(clip), 5, Scope()))
    pieces(root)[0].write_bytes(bytes(byte ^ 0x5A for byte in pieces(root)[0].read_bytes()))
    assert motionlake("verify", "--deep", "--lake", root).status == 1
    with few():
        assert motionlake("repair", "--lake", root).status == 0
    assert len(pieces(root)) == 1, "all is made anew where frames that were taken over are damaged"
    assert motionlake("verify", "--deep", "--lake", root).status == 0
    assert_alike(*both(root, Query(clip), 5, Scope()))


def test_a_lake_that_has_grown_by_half_is_looked_at_anew(
    large: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("motionlake.stages.shortlist_before.GROWN", 0.5)
    root = Path(shutil.copytree(large, tmp_path / "lake"))
    gone, clip = some(root, 2)
    before = pieces(root)
    assert motionlake("remove", gone, "--lake", root).status == 0
    with few():
        assert motionlake("run", "shortlist", "--lake", root).status == 0
    assert not set(pieces(root)) & set(before)
    assert_alike(*both(root, Query(clip), 5, Scope()))


def pieces(root: Path) -> list[Path]:
    files = [str(path.relative_to(root)) for path in root.glob("shortlist/*")]
    return [root / file for file in PIECES.among(files)]


def moves_read(patched: pytest.MonkeyPatch) -> list[str]:
    """The files of moves that the stage reads from now on, in this process."""
    found, own = [], shortlist_moves._moves_in

    def read(lake: Lake, file: str, wanted: Container[str]) -> object:
        found.append(file)
        return own(lake, file, wanted)

    patched.setattr(shortlist_moves, "_moves_in", read)
    return found


def test_a_shortlist_of_other_models_is_refused(large: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(large, tmp_path / "lake"))
    clip = some(root, 1)[0]
    with Changed(root) as con:
        con.execute("UPDATE motifs SET model = 'motifs-9'")
    with few():
        run = motionlake("search", clip, "--lake", root)
    assert (run.status, "run shortlist" in run.err) == (2, True)


def test_a_shortlist_of_moves_of_another_kind_is_refused_and_made_again(
    large: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lake = open_lake(large)

    def due() -> int:
        with few(), lake_reader(lake, load_config(lake.config_file)) as at:
            return SHORTLIST.due(at)

    assert due() == 0
    for module in ("stages.shortlist", "retrieval.lake_shortlist"):
        monkeypatch.setattr(f"motionlake.{module}.KIND", "another")
    assert due() == 1
    with few(), pytest.raises(UserError, match="run shortlist"):
        FusedSearcher(lake)
    with few(), pytest.raises(UserError, match="run shortlist"):
        searcher("range", "moves", lake)
    with few():
        assert isinstance(searcher("range", "submotion", lake), SubmotionSearcher), "which compares no moves"


@pytest.mark.parametrize("kind", ["motifs", "postures"])
def test_a_newer_model_than_the_shortlist_has_seen_is_told(large: Path, tmp_path: Path, kind: str) -> None:
    root = Path(shutil.copytree(large, tmp_path / "lake"))
    clip = some(root, 1)[0]
    name = newer(root, kind)
    with few():
        run = motionlake("search", clip, "--lake", root)
    assert (run.status, f"{name} is newer than what is compared" in run.err) == (2, True)


@pytest.mark.parametrize("name", ["signature-places.npy", "clips.arrow", "moves.f16"])
def test_a_damaged_shortlist_is_found_and_made_again(large: Path, tmp_path: Path, name: str) -> None:
    root = Path(shutil.copytree(large, tmp_path / "lake"))
    clip = some(root, 1)[0]
    (file,) = root.glob(f"shortlist/*-{name}")
    before = file.read_bytes()
    middle = len(before) // 2
    # Every byte of the second half: whichever frames the search reads of, some are others.
    file.write_bytes(before[:middle] + bytes(byte ^ 0x5A for byte in before[middle:]))
    with few():
        run = motionlake("search", clip, "--lake", root)
        assert (run.status, run.out) == (2, "")
        assert name in run.err
        assert motionlake("verify", "--deep", "--lake", root).status != 0
        assert motionlake("repair", "--lake", root).status == 0
        assert file.read_bytes() == before
        assert motionlake("verify", "--deep", "--lake", root).status == 0
        file.unlink()
        assert motionlake("search", clip, "--lake", root).status == 2


def test_a_service_reads_and_checks_all_moves_before_searches_do(large: Path, tmp_path: Path) -> None:
    """One byte of the last clip is found, which a search for another would not read."""
    root = Path(shutil.copytree(large, tmp_path / "lake"))

    def by_moves() -> ChosenSearcher:
        found = searcher("clip", "moves", open_lake(root))
        assert isinstance(found, ChosenSearcher)
        return found

    with few():
        FusedSearcher(open_lake(root)).warm_up()
        by_moves().warm_up()
        (file,) = root.glob("shortlist/*-moves.f16")
        before = bytearray(file.read_bytes())
        before[-1] ^= 1
        file.write_bytes(before)
        for each in (FusedSearcher(open_lake(root)), by_moves()):
            with pytest.raises(DamagedError, match=r"moves\.f16"):
                each.warm_up()
    FusedSearcher(open_lake(root)).warm_up()


def test_a_small_lake_has_no_shortlist(built_lake: Path) -> None:
    assert not list(built_lake.glob("shortlist/*"))
    assert FusedSearcher(Lake(built_lake))._cascade is None


clips_of_frames = st.integers(1, 9).flatmap(
    lambda m: st.integers(0, 10_000).map(
        lambda seed: np.random.default_rng(seed).normal(size=(m, 6)).astype(np.float32)
    )
)


@given(clips_of_frames, clips_of_frames)
def test_a_path_costs_what_the_alignment_does(one: np.ndarray, other: np.ndarray) -> None:
    path = clip_path(one, other)
    assert path[0].tolist() == [0, 0]
    assert path[-1].tolist() == [len(one) - 1, len(other) - 1]
    steps = np.diff(path, axis=0)
    assert ((steps >= 0) & (steps <= 1)).all()
    assert (steps.sum(axis=1) > 0).all()
    cost = np.linalg.norm(one[path[:, 0]] - other[path[:, 1]], axis=1).sum()
    assert cost / (len(one) + len(other)) == pytest.approx(clip_dtw(one, other), rel=1e-4, abs=2e-3)


def test_joints_and_frames_by_hand() -> None:
    rng = np.random.default_rng(0)
    clip = rng.normal(size=(5, 2 * 45)).astype(np.float32)
    twice = np.repeat(clip, 2, axis=0)
    twice.reshape(10, 2, 15, 3)[:, :, 4] += (0.0, 3.0, 4.0)
    match = matched_moves(clip, twice, (10, 60), 100)
    assert list(match.joints)[-1] == COMMON[4]
    assert match.joints[COMMON[4]] == pytest.approx(5 * np.sqrt(2), rel=1e-5)
    assert sum(match.joints.values()) == pytest.approx(5 * np.sqrt(2), rel=1e-5)
    assert [(step.query, step.clip) for step in match.path] == [
        ((10, 17), (0, 17)), ((17, 29), (17, 39)), ((29, 41), (39, 61)), ((41, 53), (61, 83)), ((53, 60), (83, 100)),
    ]  # fmt: skip


def test_instants_do_not_ask_how_fast() -> None:
    """A motion that lingers and hurries is nearer to itself at half by its way than by its time alone."""
    course = np.column_stack([np.linspace(0, 1, 40), np.sin(np.linspace(0, 3, 40))])
    slow_first = course[np.round(39 * np.linspace(0, 1, 60) ** 2).astype(int)]
    np.testing.assert_allclose(instants(course, 9)[[0, -1]], course[[0, -1]], rtol=1e-6)
    by_time = slow_first[np.linspace(0, 59, 9).round().astype(int)]
    ours = np.linalg.norm(instants(course, 9) - instants(slow_first, 9))
    assert ours < 0.7 * np.linalg.norm(instants(course, 9) - by_time)
    still = np.ones((1, 3))
    assert instants(still, 4).tolist() == [[1, 1, 1]] * 4


@given(st.integers(2, 30), st.integers(0, 1000))
def test_sketches_tell_who_is_near(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(count, 4)) * (9, 5, 2, 1)
    whole = Directions.of(rows, 4)
    vectors, known = whole.project(rows), rng.random(count) < 0.9
    kept = Sketches.of(vectors, known)
    assert (kept.places.dtype.name, np.isfinite(kept.norms).tolist()) == ("int16", known.tolist())
    np.testing.assert_allclose(kept.places * kept.steps, vectors, atol=0.51 * kept.steps.max())
    asked = whole.project(rows[0])
    expected = np.linalg.norm(rows - rows[0], axis=1)
    found = []
    for plain in (True, False):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("motionlake.motion.sketches.few", lambda cells, plain=plain: plain)
            found.append(kept.nearness(asked))
    assert found[0].tobytes() == found[1].tobytes(), "to the last bit"
    squares, rounding = asked @ asked - 2 * found[0][known], float(np.linalg.norm(kept.steps)) / 2
    wrong = np.abs(squares - expected[known] ** 2)
    assert (wrong <= (2 * expected[known] + rounding) * rounding + 0.05).all()
    assert (found[0][~known] == -np.inf).all()
    less = Directions.of(rows, 2).project(rows)
    assert (np.linalg.norm(less - less[0], axis=1) <= expected + 1e-4).all()

"""What every way to search must do, the same for all: whole clips and ranges."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import duckdb
import numpy as np
import pyarrow as pa
import pytest
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.lake.layout import Lake, open_lake
from motionlake.retrieval import registry
from motionlake.retrieval.fused import FusedSearcher
from motionlake.retrieval.hits import Hit, nearer_of_both
from motionlake.retrieval.protocol import Finds, LakeSearcher, Query, Scope
from motionlake.retrieval.registry import SEARCHERS, methods, ready, searcher
from motionlake.retrieval.weighing import WEIGHTS
from motionlake.stages.mapped_part import MappedPart, write_mapped
from threadpoolctl import threadpool_info, threadpool_limits

from tests.lakes import Changed, list_anew, motionlake, query, tables

EVERY: list[tuple[Finds, str]] = [(finds, name) for finds, names in SEARCHERS.items() for name in names]
EVERY_SEARCHER = pytest.mark.parametrize(("finds", "name"), EVERY, ids=lambda value: str(value))
SINGLE = tuple(name for name in methods("clip") if name != "fused")
OTHER = "copies"
K = 8
MANY = 1000
VERDICT = "(['ok', 'doubtful', 'bad'])[1 + ascii(name[-5:-5]) % 3]"  # of stage "quality", by a letter of the name


@pytest.fixture(scope="module")
def two_sets(tmp_path_factory: pytest.TempPathFactory, built_lake: Path) -> Lake:
    """The small lake with every clip once more in a second dataset: so all have a twin, as far from any other.

    Of the twins some are of split "train"; one counts as synthetic.
    """
    root = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("searchers") / "lake"))
    twins = ("clips", "signatures", "mirrored_signatures", "words", "word_motifs", "symbol_strings", "descriptors")
    with Changed(root) as con:
        for table in twins:
            rows = con.table(table).to_arrow_table()  # noqa: F841
            changed = f"REPLACE ('{OTHER}' || substr(clip, strpos(clip, '/')) AS clip"
            changed += f", '{OTHER}' AS dataset)" if table == "clips" else ")"
            con.execute(f"INSERT INTO {table} SELECT * {changed} FROM rows")
        con.execute(f"UPDATE clips SET split = 'train' WHERE dataset = '{OTHER}' AND rowid % 2 = 0")
        first = f"SELECT min(clip) FROM clips WHERE dataset = '{OTHER}'"
        con.execute(f"UPDATE clips SET format = 'synthetic' WHERE clip = ({first})")
        con.execute(f"CREATE OR REPLACE MACRO quality_verdict(name) AS {VERDICT}")
    lake = open_lake(root)
    # Those of words place the answers of "submotion", those of postures the answers of "alignment".
    for kind in ("embeddings", "postures", "submotions"):
        for part in sorted(root.glob(f"{kind}/**/*.parquet")):
            _copy_clips(part)
    for kind in ("features", "moves"):
        for part in sorted(root.glob(f"{kind}/*.arrow")):
            _copy_mapped(part)
    for part in sorted(root.glob("frames/**/*.parquet")):
        target = root / "frames" / f"dataset={OTHER}" / part.name
        target.parent.mkdir(exist_ok=True)
        shutil.copyfile(part, target)
        _copy_clips(target)
    list_anew(root)
    return lake


def _copy_clips(part: Path) -> None:
    """Every row of a Parquet part once more, of the twins."""
    with duckdb.connect() as con:
        con.execute("CREATE TABLE rows AS FROM read_parquet($part)", {"part": str(part)})
        con.execute(
            f"INSERT INTO rows SELECT * REPLACE ('{OTHER}' || substr(clip, strpos(clip, '/')) AS clip) FROM rows"
        )
        con.execute(f"COPY (FROM rows ORDER BY clip, rowid) TO '{part}' (FORMAT parquet)")


def _copy_mapped(path: Path) -> None:
    """The same of a part that is mapped."""
    part = MappedPart.open(path)
    rows = {clip: part.of(clip) for clip in part.runs}
    twins = {twin(clip): _named(table, twin(clip)) for clip, table in rows.items()}
    both = {clip: _named(table, clip) for clip, table in rows.items()} | twins
    write_mapped(path, pa.concat_tables(both[clip] for clip in sorted(both)), "key")


def _named(rows: pa.Table, clip: str) -> pa.Table:
    return rows.set_column(0, "clip", pa.repeat(clip, rows.num_rows))


def twin(clip: str) -> str:
    return f"{OTHER}/{clip.partition('/')[2]}"


def some_queries(lake: Lake, finds: Finds, count: int) -> list[Query]:
    """Clips of the first dataset whose string is long enough to be aligned; where ranges are found, parts of them."""
    text = (
        "SELECT clip, frames FROM symbol_strings JOIN clips USING (clip) JOIN signatures USING (clip) "
        "WHERE len(symbols) > 3 AND dataset = 'clips' AND seconds > 1 "
        "ORDER BY row_number() OVER (PARTITION BY format ORDER BY words DESC, clip), format DESC"
    )
    rows = query(lake.root, text)[:count]
    return [Query(clip) if finds == "clip" else Query(clip, frames // 8, frames) for clip, frames in rows]


def file_of(clips: Path, asked: Query) -> Query:
    return replace(asked, source=clips / str(asked.source).partition("/")[2])


def check_answer(lake: Lake, finds: Finds, hits: list[Hit], asked: Query) -> None:
    """Hits are clips or ranges of the lake, as it knows them, in order, and not what was asked for."""
    rows = query(lake.root, "SELECT clip, label, dataset, seconds, frames, fps FROM clips")
    known = {row[0]: row[1:] for row in rows}
    assert [hit.rank for hit in hits] == list(range(1, len(hits) + 1))
    order = [(hit.distance, hit.clip, hit.start or 0) for hit in hits]
    assert order == sorted(order)
    for hit in hits:
        label, dataset, seconds, frames, fps = known[hit.clip]
        assert (hit.label, hit.dataset) == (label, dataset)
        if finds == "clip":
            assert (hit.start, hit.stop) == (None, None)
            assert hit.seconds == pytest.approx(seconds)
            assert hit.clip != asked.clip
            continue
        assert hit.start is not None
        assert hit.stop is not None
        assert 0 <= hit.start < hit.stop <= frames
        assert hit.start_seconds == hit.start / fps
        assert hit.seconds == pytest.approx((hit.stop - hit.start) / fps)
        first, last = asked.start or 0, frames if asked.stop is None else asked.stop
        assert hit.clip != asked.clip or hit.stop <= first or hit.start >= last
        for other in hits[: hit.rank - 1]:
            assert other.clip != hit.clip or (other.stop or 0) <= hit.start or (other.start or 0) >= hit.stop
    if finds == "clip":
        assert len({hit.clip for hit in hits}) == len(hits)


@EVERY_SEARCHER
def test_only_answers_that_are_near_enough(two_sets: Lake, finds: Finds, name: str) -> None:
    found, asked = searcher(finds, name, two_sets), some_queries(two_sets, finds, 1)
    for mirrored in (False, True):
        (hits,) = found.search(asked, K, Scope(mirrored=mirrored))
        limit = hits[-1].distance
        (near,) = found.search(asked, K, Scope(mirrored=mirrored, below=limit))
        assert near == [hit for hit in hits if hit.distance < limit]
        assert found.search(asked, K, Scope(mirrored=mirrored, below=hits[0].distance)) == [[]]


@EVERY_SEARCHER
def test_clips_and_files_k_and_ties(two_sets: Lake, clips_folder: Path, finds: Finds, name: str) -> None:
    found = searcher(finds, name, two_sets)
    assert (found.name, found.finds) == (name, finds)
    queries = some_queries(two_sets, finds, 2)
    answers = found.search([*queries, *(file_of(clips_folder, asked) for asked in queries)], K)
    assert len(answers) == 4
    for asked, hits, of_file in zip(queries, answers[:2], answers[2:], strict=True):
        check_answer(two_sets, finds, hits, asked)
        check_answer(two_sets, finds, of_file, file_of(clips_folder, asked))
        assert len(hits) == len(of_file) == K
        # One by one, fewer, again, and by a searcher of its own: the same.
        assert found.search([asked], 2) == [hits[:2]]
        assert searcher(finds, name, two_sets).search([asked], K) == [hits]
        (everything,) = found.search([asked], MANY)
        check_answer(two_sets, finds, everything, asked)
        assert [hit.clip for hit in everything[:K]] == [hit.clip for hit in hits]
        assert twin(asked.name) in {hit.clip for hit in everything}
        assert found.search([asked], 0) == [[]]
    assert found.search([], 5) == []
    with pytest.raises(UserError, match="k is -1"):
        found.search([Query("clips/nobody.bvh")], -1)


@EVERY_SEARCHER
def test_the_scope_says_which_clips_may_be_answers(two_sets: Lake, finds: Finds, name: str) -> None:
    found, (asked,) = searcher(finds, name, two_sets), some_queries(two_sets, finds, 1)
    (everything,) = found.search([asked], MANY)
    of_split = {row[0] for row in query(two_sets.root, "SELECT clip FROM clips WHERE split = 'train'")}
    recorded = {row[0] for row in query(two_sets.root, "SELECT clip FROM clips WHERE format <> 'synthetic'")}
    of_set = {hit.clip for hit in everything if hit.dataset == OTHER}
    verdicts = dict(query(two_sets.root, "SELECT clip, quality_verdict(clip) FROM clips"))
    assert set(verdicts.values()) == {"ok", "doubtful", "bad"}
    good, better = ({clip for clip, verdict in verdicts.items() if verdict in least}
                    for least in (("ok", "doubtful"), ("ok",)))  # fmt: skip
    for scope, clips in (
        (Scope(OTHER), of_set),
        (Scope(split="train"), of_split),
        (Scope(recorded_only=True), recorded),
        (Scope(OTHER, "train", recorded_only=True), of_split & recorded),
        (Scope(min_quality="doubtful"), good),
        (Scope(OTHER, min_quality="ok"), of_set & better),
    ):
        (hits,) = found.search([asked], MANY, scope)
        check_answer(two_sets, finds, hits, asked)
        assert {hit.clip for hit in hits} == {hit.clip for hit in everything} & clips
        assert hits
        if name != "fused":  # whose distances depend on what was to be chosen from
            kept = [replace(hit, rank=0) for hit in everything if hit.clip in clips]
            assert [replace(hit, rank=0) for hit in hits] == kept
    assert found.search([asked], 5, Scope("elsewhere")) == [[]]
    assert found.search([asked], 5, Scope(split="elsewhere")) == [[]]
    with pytest.raises(UserError, match="use ok or doubtful"):
        found.search([asked], 5, Scope(min_quality="fine"))


@EVERY_SEARCHER
def test_the_query_itself_may_be_an_answer(two_sets: Lake, finds: Finds, name: str) -> None:
    found, (asked,) = searcher(finds, name, two_sets), some_queries(two_sets, finds, 1)
    (own,) = found.search([asked], MANY, Scope(own=True))
    best = {hit.clip: hit.distance for hit in reversed(own)}
    assert best[asked.name] == pytest.approx(best[twin(asked.name)], abs=1e-6)
    if name != "submotion":  # which compares the piece with windows that are longer
        assert best[asked.name] < 0.01


@EVERY_SEARCHER
def test_the_mirror_image_may_be_looked_for_too(two_sets: Lake, finds: Finds, name: str) -> None:
    found, queries = searcher(finds, name, two_sets), some_queries(two_sets, finds, 3)
    answers = found.search(queries, MANY, Scope(mirrored=True))
    assert any(hit.mirrored for hits in answers for hit in hits)
    for asked, plain, both in zip(queries, found.search(queries, MANY), answers, strict=True):
        check_answer(two_sets, finds, both, asked)
        assert not any(hit.mirrored for hit in plain)
        if name == "fused":
            continue
        best, nearer = ({hit.clip: hit for hit in reversed(hits)} for hits in (plain, both))
        for clip, hit in best.items():
            assert nearer[clip].distance <= hit.distance + 1e-9
            assert nearer[clip].mirrored or nearer[clip].distance == hit.distance
        assert found.search([asked], 3, Scope(mirrored=True)) == [both[:3]]


@EVERY_SEARCHER
def test_distances_are_those_of_the_answers(two_sets: Lake, clips_folder: Path, finds: Finds, name: str) -> None:
    found, queries = searcher(finds, name, two_sets), some_queries(two_sets, finds, 2)
    (hits,) = found.search(queries[:1], MANY, Scope("clips"))
    best: dict[str, float] = {}
    for hit in hits:
        best.setdefault(hit.clip, hit.distance)
    gallery = [Query(clip) for clip in sorted(best)]
    matrix = found.distances(queries, gallery)
    assert matrix.shape == (2, len(gallery))
    if name != "fused":
        expected = [best[asked.name] for asked in gallery if asked.clip != queries[0].clip]
        rows = [d for d, asked in zip(matrix[0].tolist(), gallery, strict=True) if asked.clip != queries[0].clip]
        assert rows == pytest.approx(expected, abs=1e-5)
    assert found.distances([queries[0]], [queries[0]])[0, 0] == pytest.approx(0, abs=1e-3)
    of_file = found.distances([file_of(clips_folder, queries[0])], gallery[:3])
    if name != "fused":
        assert of_file[0].tolist() == pytest.approx(matrix[0, :3].tolist(), rel=0.2, abs=0.05)
    assert found.distances([], gallery).shape == (0, len(gallery))


@EVERY_SEARCHER
def test_what_a_searcher_refuses(two_sets: Lake, tmp_path: Path, finds: Finds, name: str) -> None:
    found, (asked,) = searcher(finds, name, two_sets), some_queries(two_sets, finds, 1)
    damaged = tmp_path / "damaged.bvh"
    damaged.write_text("HIERARCHY\nROOT Hips\n{", encoding="utf-8")
    for unknown in (Query("clips/nobody.bvh"), Query(tmp_path / "nothing.bvh"), Query(damaged)):
        with pytest.raises(UserError, match=r"nobody|nothing|damaged"):
            found.search([unknown], 3)
    with pytest.raises(UserError, match="has frames 0 to"):
        found.search([replace(asked, start=9, stop=4)], 3)


@EVERY_SEARCHER
def test_the_command_line_gives_the_same_answers(two_sets: Lake, clips_folder: Path, finds: Finds, name: str) -> None:
    (asked,) = some_queries(two_sets, finds, 1)
    command = "search" if finds == "clip" else "find"
    edges: list[Any] = [] if asked.start is None else ["--from", asked.start, "--to", asked.stop]
    for each in (asked, file_of(clips_folder, asked)):
        for scope, flags in (
            (Scope(OTHER), ["--dataset", OTHER]),
            (Scope(split="train", own=True), ["--split", "train", "--own"]),
            (Scope(recorded_only=True, mirrored=True), ["--recorded-only", "--mirrored"]),
            (Scope(min_quality="ok"), ["--min-quality", "ok"]),
        ):
            expected = searcher(finds, name, two_sets).search([each], 3, scope)[0]
            words = [command, each.source, *edges, "-k", 3, *flags, "--method", name, "--lake", two_sets.root, "--json"]
            rows = motionlake(*words).json
            if finds == "clip":
                assert {row.pop("query") for row in rows} == {each.name}
            assert rows == [hit.as_row() for hit in expected]


def test_a_part_of_a_clip_is_searched_for_too(two_sets: Lake) -> None:
    """Clips like some frames of one: nearer than the whole of it is to its twin is none but by chance."""
    (whole,) = some_queries(two_sets, "clip", 1)
    ((frames,),) = query(two_sets.root, "SELECT frames FROM clips WHERE clip = $clip", clip=whole.name)
    for name in methods("clip"):
        found = searcher("clip", name, two_sets)
        part = replace(whole, start=0, stop=frames // 2)
        (hits,) = found.search([part], K)
        check_answer(two_sets, "clip", hits, part)
        assert found.search([replace(whole, start=0, stop=frames)], K, Scope(OTHER))[0][0].distance < 0.2
    words = ["search", whole.name, "--to", frames // 2, "-k", K, "--lake", two_sets.root, "--json"]
    (expected,) = searcher("clip", "fused", two_sets).search([replace(whole, start=None, stop=frames // 2)], K)
    assert [{**row, "query": ""} for row in motionlake(*words).json] == [
        {"query": "", **hit.as_row()} for hit in expected
    ]


def test_the_command_line_refuses_what_there_is_not(built_lake: Path) -> None:
    for command, said in (
        ("search", "not one of fused, signature, alignment, descriptor, moves"),
        ("find", "not one of fused, words, alignment, submotion, moves"),
    ):
        run = motionlake(command, "anything", "--method", "magic", "--lake", built_lake)
        assert (run.status, run.out) == (2, "")
        assert said in run.err


TABLES = {
    "signature": "motifs", "alignment": "postures", "descriptor": "descriptors",
    "moves": "manifest WHERE stage = 'moves'",
}  # fmt: skip


@pytest.mark.parametrize("name", SINGLE)
def test_a_lake_that_is_not_ready(lake: Path, name: str) -> None:
    """A method without its table says how to make it; the fused one does without that method."""
    root = open_lake(lake)
    (asked,) = some_queries(root, "clip", 1)
    empty(lake, TABLES[name], *(["signatures"] if name == "signature" else []))
    run = motionlake("search", asked.name, "--method", name, "--lake", lake)
    assert run.status == 2
    assert "make them with `motionlake run all`" in run.err
    others = [other for other in SINGLE if other != name]
    assert ready(root, "clip") == ["fused", *others]
    rest = FusedSearcher(root, searchers={
        other: cast(LakeSearcher, searcher("clip", other, root)) for other in others if other in WEIGHTS
    })  # fmt: skip
    assert searcher("clip", "fused", root).search([asked], 4) == rest.search([asked], 4)


def test_a_lake_that_is_ready_for_nothing(lake: Path) -> None:
    (asked,) = some_queries(open_lake(lake), "clip", 1)
    empty(lake, "signatures", *TABLES.values())
    run = motionlake("search", asked.name, "--method", "fused", "--lake", lake)
    assert run.status == 2
    assert "`motionlake run all`" in run.err


def empty(lake: Path, *names: str) -> None:
    with Changed(lake) as con:
        for name in names:
            con.execute(f"DELETE FROM {name}")


def hit(clip: str, distance: float, **more: Any) -> Hit:
    return Hit(rank=more.pop("rank", 0), clip=clip, distance=distance, label=None, dataset="set", seconds=1.0, **more)


class Fixed(LakeSearcher):
    """A searcher whose answers are known."""

    name = "fixed"
    finds: Finds = "clip"

    def __init__(self, *distances: tuple[str, float]) -> None:
        self._distances = distances

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        if not self._distances:
            raise UserError("cannot")
        rows = [hit(clip, far) for clip, far in self._distances]
        return [rows[:k] for _ in queries]

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        known = dict(self._distances)
        return np.array([[known[each.name] for each in gallery] for _ in queries])


def fused(lake: Lake, *searchers: Fixed, graph: bool = False) -> FusedSearcher:
    return FusedSearcher(lake, searchers={str(i): each for i, each in enumerate(searchers)}, graph=graph, explain=True)


def test_fusion_by_definition(built_lake: Path) -> None:
    lake = open_lake(built_lake)
    one, two = Fixed(("a", 1.0), ("b", 2.0), ("c", 4.0)), Fixed(("c", 10.0), ("a", 20.0), ("d", 40.0))
    (hits,) = fused(lake, one, two, Fixed()).search([Query("q")], 10)
    # Fewer than ten answers: units are the farthest, 4 and 40; d is as far as c for the first, b as d for the second.
    near = {"a": (4 / 5, 2 / 3), "b": (2 / 3, 1 / 2), "c": (1 / 2, 4 / 5), "d": (1 / 2, 1 / 2)}
    expected: list[tuple[str, Any]] = sorted(
        ((clip, pytest.approx(1 - sum(each) / 2)) for clip, each in near.items()), key=lambda pair: -sum(near[pair[0]])
    )
    assert [(each.clip, each.distance) for each in hits] == expected
    shares = {each.clip: each.shares or () for each in hits}
    assert [(s.method, s.weight, s.distance, s.near, s.along) for s in shares["d"]] == [
        ("0", 0.5, None, 0.5, None),
        ("1", 0.5, 40.0, 0.5, None),
    ]
    matrix = fused(lake, one, Fixed(("a", 3.0), ("b", 6.0), ("c", 1.0))).distances(
        [Query("q")], [Query("a"), Query("b"), Query("c")]
    )
    expected_row = [1 - (4 / 5 + 6 / 9) / 2, 1 - (4 / 6 + 6 / 12) / 2, 1 - (4 / 8 + 6 / 7) / 2]
    np.testing.assert_allclose(matrix, [expected_row])
    with pytest.raises(UserError, match="cannot"):
        fused(lake, Fixed()).search([Query("q")], 1)
    with pytest.raises(UserError, match="is not ready for search"):
        fused(lake)


def test_the_nearer_of_both_sides_by_hand() -> None:
    plain, turned = [hit("a", 1.0), hit("b", 3.0)], [hit("b", 2.0), hit("a", 1.0)]
    both = nearer_of_both(plain, turned, 5)
    assert [(each.rank, each.clip, each.distance, each.mirrored) for each in both] == [
        (1, "a", 1.0, False),
        (2, "b", 2.0, True),
    ]
    apart = [hit("a", 1.0, start=0, stop=10), hit("a", 2.0, start=10, stop=20)]
    found = nearer_of_both(apart, [hit("a", 1.5, start=5, stop=15)], 5, apart=True)
    assert [(each.start, each.mirrored) for each in found] == [(0, False), (10, False)]


def test_a_new_searcher_is_a_module_and_a_line(two_sets: Lake, monkeypatch: pytest.MonkeyPatch) -> None:
    """The registry is all that a command needs to know of one."""
    monkeypatch.setitem(registry.SEARCHERS["clip"], "by_name", "by_name:ByName")
    import sys
    import types

    module = types.ModuleType("motionlake.retrieval.by_name")

    class ByName(Fixed):
        def __init__(self, lake: Lake) -> None:
            LakeSearcher.__init__(self, lake)
            super().__init__(("clips/a", 0.5))

    module.ByName = ByName  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "motionlake.retrieval.by_name", module)
    (asked,) = some_queries(two_sets, "clip", 1)
    rows = motionlake("search", asked.name, "--method", "by_name", "--lake", two_sets.root, "--json").json
    assert [(row["clip"], row["distance"]) for row in rows] == [("clips/a", 0.5)]


def test_searching_changes_nothing(two_sets: Lake) -> None:
    before = tables(two_sets.root)
    for name in methods("clip"):
        assert motionlake("search", "--sample", 2, "--method", name, "--lake", two_sets.root).status == 0
    assert tables(two_sets.root) == before


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize(("finds", "name", "method"), [("clip", "signature", "nearest"), ("range", "words", "_ranges")])
def test_linear_algebra_has_one_thread_however_many_ask(
    two_sets: Lake, finds: Finds, name: str, method: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sums of several threads round otherwise than those of one, on some machines."""
    found = searcher(finds, name, two_sets)
    plain, seen = getattr(found, method), set[int]()

    def watched(*given: Any, **more: Any) -> Any:
        seen.update(pool["num_threads"] for pool in threadpool_info())
        return plain(*given, **more)

    monkeypatch.setattr(found, method, watched)
    with threadpool_limits(2):
        found.search(some_queries(two_sets, finds, count), K)
    assert seen == {1}

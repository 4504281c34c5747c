"""What every method of retrieving whole clips must do, the same for all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import duckdb
import pytest
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import open_lake
from motionlake.retrieval.connection import connect
from motionlake.retrieval.fused import FusedRetriever
from motionlake.retrieval.methods import METHODS, SINGLE, ready_methods, retriever
from motionlake.retrieval.protocol import Query, Retriever
from motionlake.retrieval.search import Hit

from tests.lakes import motionlake, query, tables

EVERY_METHOD = pytest.mark.parametrize("method", METHODS)
OTHER = "copies"
K = 8


@pytest.fixture(scope="module")
def two_sets(tmp_path_factory: pytest.TempPathFactory, built_lake: Path) -> Path:
    """The small lake with every clip once more in a second dataset: so all have a twin, as far from any other."""
    root = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("retrievers") / "lake"))
    with duckdb.connect(str(root / "catalog.duckdb")) as con:
        for table in ("clips", "signatures", "symbol_strings", "descriptors"):
            twins = con.table(table).to_arrow_table()  # noqa: F841
            dataset = f"REPLACE ('{OTHER}' || substr(clip, strpos(clip, '/')) AS clip"
            dataset += f", '{OTHER}' AS dataset)" if table == "clips" else ")"
            con.execute(f"INSERT INTO {table} SELECT * {dataset} FROM twins")
    return root


def twin(clip: str) -> str:
    return f"{OTHER}/{clip.partition('/')[2]}"


@pytest.fixture
def con(two_sets: Path) -> Iterator[Connection]:
    con = connect(two_sets)
    yield con
    con.close()


def source(clips: Path, clip: str) -> Path:
    return clips / clip.partition("/")[2]


def some_clips(lake: Path, count: int) -> list[str]:
    """Clips of the first dataset whose string is long enough to be aligned."""
    text = "SELECT clip FROM symbol_strings JOIN clips USING (clip) WHERE len(symbols) > 1 AND dataset = 'clips'"
    rows = query(lake, f"{text} ORDER BY md5(clip)")
    return [clip for (clip,) in rows][:count]


def at_zero(hits: list[Hit]) -> set[str]:
    """The first clips: few motifs and few symbols do not tell all clips apart."""
    return {hit.clip for hit in hits if hit.distance < 0.01}


def check_answer(lake: Path, hits: list[Hit], asked: Query) -> None:
    """Hits are clips of the lake, as it knows them, in order, each once, and not the one asked for."""
    known = {row[0]: row[1:] for row in query(lake, "SELECT clip, label, dataset, seconds FROM clips")}
    assert [hit.rank for hit in hits] == list(range(1, len(hits) + 1))
    assert [(hit.label, hit.dataset, pytest.approx(hit.seconds)) for hit in hits] == [known[hit.clip] for hit in hits]
    assert [(hit.distance, hit.clip) for hit in hits] == sorted((hit.distance, hit.clip) for hit in hits)
    assert len({hit.clip for hit in hits}) == len(hits)
    assert asked not in {hit.clip for hit in hits}
    assert all(hit.distance >= 0 for hit in hits)


@EVERY_METHOD
def test_a_retriever(two_sets: Path, clips_folder: Path, con: Connection, method: str) -> None:
    """The protocol: clips and files, k, one dataset, ties, order, the same answer twice."""
    found: Retriever = retriever(method, con, open_lake(two_sets))
    assert found.method == method
    clips = some_clips(two_sets, 3)
    files = [source(clips_folder, clip) for clip in clips]
    count = len(query(two_sets, "FROM clips"))
    answers = found.search([*clips, *files], K)
    assert [len(hits) for hits in answers] == [K] * 6
    for clip, hits, of_file in zip(clips, answers[:3], answers[3:], strict=True):
        check_answer(two_sets, hits, clip)
        assert twin(clip) in at_zero(hits)
        check_answer(two_sets, of_file, files[0])
        assert {clip, twin(clip)} <= at_zero(of_file)
        # One by one, fewer, again, and by a retriever of its own: the same.
        assert found.search([clip], 2) == [hits[:2]]
        assert retriever(method, con, open_lake(two_sets)).search([clip], K) == [hits]
        everything = found.search([clip], 10 * count)[0]
        check_answer(two_sets, everything, clip)
        assert [hit.clip for hit in everything[:K]] == [hit.clip for hit in hits]
        for dataset in ("clips", OTHER):
            mine = found.search([clip], 10 * count, dataset)[0]
            check_answer(two_sets, mine, clip)
            assert {hit.dataset for hit in mine} == {dataset}
            if method != "fused":  # whose distances depend on what was to be chosen from
                of_set = [(hit.clip, hit.distance) for hit in everything if hit.dataset == dataset]
                assert [(hit.clip, hit.distance) for hit in mine] == of_set
        assert found.search([clip], 5, "elsewhere") == [[]]
    assert found.search([], 5) == []


@EVERY_METHOD
def test_what_a_retriever_refuses(two_sets: Path, con: Connection, tmp_path: Path, method: str) -> None:
    found = retriever(method, con, open_lake(two_sets))
    for unknown in ("clips/nobody.bvh", tmp_path / "nothing.bvh", damaged_file(tmp_path)):
        with pytest.raises(UserError, match=r"nobody|nothing|damaged"):
            found.search([unknown], 3)


def damaged_file(folder: Path) -> Path:
    path = folder / "damaged.bvh"
    path.write_text("HIERARCHY\nROOT Hips\n{", encoding="utf-8")
    return path


@EVERY_METHOD
def test_the_command_line_gives_the_same_answers(
    two_sets: Path, clips_folder: Path, con: Connection, method: str
) -> None:
    clip = some_clips(two_sets, 1)[0]
    file = source(clips_folder, clip)
    expected = retriever(method, con, open_lake(two_sets)).search([clip, file], 3, OTHER)
    con.close()  # a process that opens a catalog twice shares its functions
    run = motionlake(
        "search", clip, file, "-k", 3, "--dataset", OTHER, "--method", method, "--lake", two_sets, "--json"
    )
    rows = run.json
    assert [row.pop("query") for row in rows] == [clip] * 3 + [str(file)] * 3
    assert rows == [hit.as_row() for hits in expected for hit in hits]


def test_the_command_line_refuses_what_does_not_go_together(built_lake: Path) -> None:
    clip = some_clips(built_lake, 1)[0]
    for words, said in (
        (["--method", "descriptor", "--mirrored"], "searches by signature, not by descriptor"),
        (["--method", "magic"], "not one of signature, alignment, descriptor, fused"),
    ):
        run = motionlake("search", clip, *words, "--lake", built_lake)
        assert (run.status, run.out) == (2, "")
        assert said in run.err
    assert motionlake("search", clip, "--method", "signature", "--mirrored", "--lake", built_lake).status == 0


TABLES = {"signature": "motifs", "alignment": "postures", "descriptor": "descriptors"}


@pytest.mark.parametrize("method", SINGLE)
def test_a_lake_that_is_not_ready(lake: Path, method: str) -> None:
    """A method without its table says how to make it; the fused one does without that method."""
    clip = some_clips(lake, 1)[0]
    empty(lake, TABLES[method])
    run = motionlake("search", clip, "--method", method, "--lake", lake)
    assert run.status == 2
    assert "make them with `motionlake run all`" in run.err
    con = connect(lake)
    try:
        assert ready_methods(con) == [name for name in SINGLE if name != method]
        rest = FusedRetriever([retriever(name, con, open_lake(lake)) for name in SINGLE if name != method])
        assert retriever("fused", con, open_lake(lake)).search([clip], 4) == rest.search([clip], 4)
    finally:
        con.close()


def test_a_lake_that_is_ready_for_nothing(lake: Path) -> None:
    empty(lake, *TABLES.values())
    run = motionlake("search", some_clips(lake, 1)[0], "--method", "fused", "--lake", lake)
    assert run.status == 2
    assert "`motionlake run all`" in run.err


def empty(lake: Path, *names: str) -> None:
    with duckdb.connect(str(lake / "catalog.duckdb")) as con:
        for name in names:
            con.execute(f"DELETE FROM {name}")


class Fixed:
    """A retriever whose answers are known."""

    method = "fixed"

    def __init__(self, *distances: tuple[str, float]) -> None:
        self._distances = distances

    def search(self, queries: Sequence[Query], k: int, dataset: str | None = None) -> list[list[Hit]]:
        if not self._distances:
            raise UserError("cannot")
        rows = [Hit(rank, clip, far, None, "set", 1.0) for rank, (clip, far) in enumerate(self._distances, start=1)]
        return [rows[:k] for _ in queries]


def test_fusion_by_definition() -> None:
    one, two = Fixed(("a", 1.0), ("b", 2.0), ("c", 4.0)), Fixed(("c", 10.0), ("a", 20.0), ("d", 40.0))
    by_distance = FusedRetriever([one, two, Fixed()]).search(["q"], 10)[0]
    # Over the medians 2 and 20; d is as far as c for the first, b as far as d for the second.
    expected: list[tuple[str, Any]] = [("a", 0.75), ("c", 1.25), ("b", 1.5), ("d", 2.0)]
    assert [(hit.clip, pytest.approx(hit.distance)) for hit in by_distance] == expected
    by_rank = FusedRetriever([one, two], by="rank").search(["q"], 2)[0]
    assert [(hit.rank, hit.clip) for hit in by_rank] == [(1, "a"), (2, "c")]
    assert by_rank[0].distance == pytest.approx((0 + 1 - 61 / 62) / 2)
    with pytest.raises(UserError, match="cannot"):
        FusedRetriever([Fixed()]).search(["q"], 1)
    with pytest.raises(ValueError, match="no retrievers"):
        FusedRetriever([])
    with pytest.raises(ValueError, match="'chance'"):
        FusedRetriever([one], by="chance")


def test_searching_changes_nothing(two_sets: Path) -> None:
    before = tables(two_sets)
    for method in METHODS:
        assert motionlake("search", "--sample", 2, "--method", method, "--lake", two_sets).status == 0
    assert tables(two_sets) == before

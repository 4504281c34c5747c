"""One answer, however it is asked for: command line, SQL, Python, by a clip's name or by its file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from motionlake.deep_motifs.emd import emd, ground_distances
from motionlake.lake.layout import open_lake
from motionlake.retrieval.protocol import Query
from motionlake.retrieval.signature import SignatureSearcher
from motionlake.retrieval.sql_functions import connect

from tests.lakes import Changed, motionlake, query

Answer = list[tuple[int, str, float]]
K = 6

SIGNATURE = ("--method", "signature")


def by_command_line(lake: Path, clip: str, source: Path) -> Answer:
    rows = motionlake("search", clip, "-k", K, *SIGNATURE, "--lake", lake, "--json").json
    return [(r["rank"], r["clip"], r["distance"]) for r in rows]


def by_sql_command(lake: Path, clip: str, source: Path) -> Answer:
    rows = motionlake("sql", f"FROM similar_clips('{clip}', {K}, method := 'signature')", "--lake", lake, "--json").json
    return [(r["rank"], r["clip"], r["distance"]) for r in rows]


def by_connection(lake: Path, clip: str, source: Path) -> Answer:
    con = connect(lake)
    try:
        text = "SELECT rank, clip, distance FROM similar_clips($clip, $k, method := 'signature')"
        return con.execute(text, {"clip": clip, "k": K}).fetchall()
    finally:
        con.close()


def by_python(lake: Path, clip: str, source: Path) -> Answer:
    (hits,) = SignatureSearcher(open_lake(lake)).search([Query(clip)], K)
    return [(h.rank, h.clip, h.distance) for h in hits]


def by_file(lake: Path, clip: str, source: Path) -> Answer:
    """The clip's own file, as one that is not in the lake: itself comes first."""
    (hits,) = SignatureSearcher(open_lake(lake)).search([Query(source / clip.partition("/")[2])], K + 1)
    assert hits[0].distance == pytest.approx(0, abs=1e-6)
    hits = [h for h in hits if h.clip != clip]
    return [(rank, h.clip, h.distance) for rank, h in enumerate(hits, start=1)]


def by_definition(lake: Path, clip: str, source: Path) -> Answer:
    """The naive oracle: the distance to every signature, sorted."""
    rows = query(lake, "SELECT clip, signature FROM signatures ORDER BY clip")
    centroids = query(lake, "SELECT centroid FROM motifs ORDER BY motif")
    ground = ground_distances(np.array([r[0] for r in centroids], dtype=np.float32))
    signatures = dict(rows)
    found = [(emd(signatures[clip], s, ground), name) for name, s in rows if name != clip]
    return [(rank, name, distance) for rank, (distance, name) in enumerate(sorted(found)[:K], start=1)]


@pytest.mark.parametrize("retriever", [by_command_line, by_sql_command, by_connection, by_python, by_file])
def test_every_way_to_ask_gives_the_same_answer(
    built_lake: Path, clips_folder: Path, retriever: Callable[[Path, str, Path], Answer]
) -> None:
    for (clip,) in query(built_lake, "SELECT clip FROM clips ORDER BY md5(clip) LIMIT 4"):
        expected = by_definition(built_lake, clip, clips_folder)
        answer = retriever(built_lake, clip, clips_folder)
        assert [row[2] for row in answer] == pytest.approx([row[2] for row in expected], abs=1e-6)
        assert {row[1] for row in answer} == {row[1] for row in expected}
        assert [row[0] for row in answer] == list(range(1, K + 1))


def test_a_file_has_the_signature_that_the_lake_gave_its_clip(built_lake: Path, clips_folder: Path) -> None:
    con = connect(built_lake)
    try:
        rows = con.execute("SELECT path, signature FROM signatures JOIN clips USING (clip) ORDER BY clip").fetchall()
        searcher = SignatureSearcher(open_lake(built_lake))
        for path, signature in rows:
            found = searcher.signature(Query(clips_folder / path))
            # A word near the border between two motifs may fall the other way before its frames are quantised.
            assert (
                np.abs(found - signature).sum()
                <= 2.5
                / query(
                    built_lake, "SELECT words FROM signatures JOIN clips USING (clip) WHERE path = $path", path=path
                )[0][0]
            )
    finally:
        con.close()


def test_signatures_are_histograms(built_lake: Path) -> None:
    rows = query(built_lake, "SELECT signature, words FROM signatures")
    assert len(rows) == query(built_lake, "SELECT count(*) FROM clips")[0][0]
    for signature, words in rows:
        assert len(signature) == 12
        assert min(signature) >= 0
        assert sum(signature) == pytest.approx(1, abs=1e-5)
        assert words > 0


def test_signatures_weigh_words_by_tf_idf(built_lake: Path) -> None:
    """Those of the lake, those that SQL makes of any words, and that of a query, each against a loop over its words."""
    idf = [weight for (weight,) in query(built_lake, "SELECT idf FROM motifs ORDER BY motif")]

    def naive(motifs: list[int]) -> np.ndarray:
        weights = [sum(motif == m for motif in motifs) * idf[m] for m in range(len(idf))]
        return np.asarray(np.array(weights) / sum(weights), dtype=np.float32)

    text = "SELECT clip, list(motif ORDER BY word), signature FROM word_motifs JOIN signatures USING (clip)"
    text += " GROUP BY clip, signature ORDER BY clip"
    rows = query(built_lake, text)
    assert len({motif for _, motifs, _ in rows for motif in motifs}) > 3
    for _, motifs, signature in rows:
        np.testing.assert_array_equal(np.float32(signature), naive(motifs))
    halves = (
        "WITH found AS (FROM word_motifs WHERE word % 2 = 0) SELECT signature FROM signatures_of(found) ORDER BY clip"
    )
    for (half,), (_, motifs, _) in zip(query(built_lake, halves), rows, strict=True):
        np.testing.assert_array_equal(np.float32(half), naive(motifs[::2]))
    searcher = SignatureSearcher(open_lake(built_lake))
    for clip, motifs, _ in rows:
        ranges = query(built_lake, "SELECT start, stop FROM words WHERE clip = $clip ORDER BY word", clip=clip)
        asked = Query(clip, ranges[0][0], ranges[-1][1] - 1)
        inside = [m for m, (_, stop) in zip(motifs, ranges, strict=True) if stop < ranges[-1][1]]
        if inside:
            np.testing.assert_array_equal(searcher.signature(asked), naive(inside))


def test_answers_may_be_kept_to_a_dataset(built_lake: Path) -> None:
    clip = query(built_lake, "SELECT min(clip) FROM clips")[0][0]
    assert motionlake("search", clip, "--dataset", "clips", "-k", 3, "--lake", built_lake, "--json").json
    assert motionlake("search", clip, "--dataset", "elsewhere", "--lake", built_lake, "--json").json == []


def test_several_queries_at_once(built_lake: Path) -> None:
    names = [r[0] for r in query(built_lake, "SELECT clip FROM clips ORDER BY clip LIMIT 2")]
    rows = motionlake("search", *names, "-k", 2, "--lake", built_lake, "--json").json
    assert [r["query"] for r in rows] == [names[0]] * 2 + [names[1]] * 2
    assert rows[:2] == motionlake("search", names[0], "-k", 2, "--lake", built_lake, "--json").json


def mirrored_by_definition(lake: Path, clip: str) -> list[tuple[int, str, float, bool]]:
    """The naive oracle: the nearer of both distances to every signature, sorted."""
    centroids = query(lake, "SELECT centroid FROM motifs ORDER BY motif")
    ground = ground_distances(np.array([r[0] for r in centroids], dtype=np.float32))
    signatures = dict(query(lake, "SELECT clip, signature FROM signatures"))
    turned = query(lake, "SELECT signature FROM mirrored_signatures WHERE clip = $clip", clip=clip)[0][0]
    found = []
    for name, signature in signatures.items():
        straight, other = emd(signatures[clip], signature, ground), emd(turned, signature, ground)
        if name != clip:
            found.append((min(straight, other), name, other < straight))
    ranked = enumerate(sorted(found)[:K], start=1)
    return [(rank, name, distance, mirrored) for rank, (distance, name, mirrored) in ranked]


def test_a_mirrored_search_ranks_by_the_nearer_of_both(built_lake: Path, clips_folder: Path) -> None:
    flags: set[bool] = set()
    for count, (clip,) in enumerate(query(built_lake, "SELECT clip FROM clips ORDER BY md5(clip)")):
        if count >= 4 and flags == {True, False}:
            break
        expected = mirrored_by_definition(built_lake, clip)
        words = ["--mirrored", *SIGNATURE, "--lake", built_lake, "--json"]
        rows = motionlake("search", clip, "-k", K, *words).json
        assert [(r["rank"], r["clip"], r["mirrored"]) for r in rows] == [(r[0], r[1], r[3]) for r in expected]
        assert [r["distance"] for r in rows] == pytest.approx([r[2] for r in expected], abs=1e-6)
        flags |= {r["mirrored"] for r in rows}
        of_file = motionlake("search", clips_folder / clip.partition("/")[2], "-k", K + 1, *words).json
        assert of_file[0]["distance"] == pytest.approx(0, abs=1e-6)
        assert [r["distance"] for r in of_file if r["clip"] != clip] == pytest.approx(
            [r[2] for r in expected], abs=1e-6
        )
    assert flags == {True, False}


def test_a_lake_without_mirrored_signatures_says_what_to_do(lake: Path, scheduler: str) -> None:
    clip = query(lake, "SELECT min(clip) FROM clips")[0][0]
    con = Changed(lake)
    con.execute("DELETE FROM mirrored_signatures")
    con.execute("DELETE FROM manifest WHERE stage = 'mirrored'")
    con.close()
    assert motionlake("search", clip, "--lake", lake).status == 0
    run = motionlake("search", clip, "--mirrored", *SIGNATURE, "--lake", lake)
    assert (run.status, run.err.count("\n")) == (2, 1)
    assert "no mirrored signature yet; make it with `motionlake run all`" in run.err
    assert motionlake("run", "mirrored", "--lake", lake, "--scheduler", scheduler).status == 0
    assert motionlake("search", clip, "--mirrored", "--lake", lake).status == 0


def test_what_could_not_be_compared_is_said(lake: Path) -> None:
    """A clip that a stage has not reached yet is ranked by the other methods, and a line says so."""
    ((clip,),) = query(lake, "SELECT min(clip) FROM symbol_strings WHERE len(symbols) > 1")
    whole = motionlake("search", clip, "-k", 3, "--lake", lake)
    assert "by the other methods alone" not in whole.err
    with Changed(lake) as con:
        con.execute("DELETE FROM signatures WHERE clip = ?", [clip])
    found = motionlake("search", clip, "-k", 3, "--lake", lake, "--json")
    assert (found.status, len(found.json)) == (0, 3)
    assert found.err.count("\n") == 1
    assert f"by the other methods alone: {clip}: has no signature yet" in found.err

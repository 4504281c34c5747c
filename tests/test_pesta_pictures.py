"""Pictures of symbol strings and alignments show what the lake holds, can be read, and say when they cannot be made."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from motionlake.deep_motifs.clip_map import tsne
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake
from motionlake.motion.features import body_length, word_features
from motionlake.motion.rotations import from_axis_angle, rotate
from motionlake.motion.skeleton import COMMON, INDEX
from motionlake.pesta.config import PosturesConfig
from motionlake.pictures.evaluation import confusion_figure, precision_recall_figure, robustness_figure
from motionlake.pictures.maps import posture_map
from motionlake.pictures.stick_figures import postures_view
from motionlake.pictures.style import motif_colours
from motionlake.pictures.symbol_columns import path_indices
from motionlake.pictures.symbol_figures import (
    AlignedPath,
    StripOfSymbols,
    SymbolRow,
    alignment_matrix,
    folds,
    symbol_strip,
)
from motionlake.pictures.symbol_material import SymbolMaterial, posture_bodies, read_symbols
from motionlake.pictures.symbol_pictures import AlignmentPictures, posture_sample, strip_of
from motionlake.retrieval.alignment import AlignmentRangeSearcher
from motionlake.retrieval.protocol import Query
from numpy.typing import NDArray

from tests.lakes import Changed, motionlake, query
from tests.test_pictures import NASTY, assert_readable, assert_self_contained, standing

COLOURS = motif_colours(np.arange(300))


def row(name: str, symbols: list[int], *, lost: int | None = None) -> SymbolRow:
    bodies = standing(len(symbols))
    if lost is not None:
        bodies[lost] = np.nan
    return SymbolRow(name, "frames 0 to 9, 0.00–0.30 s", np.array(symbols), bodies)


def distances(rows: int, columns: int) -> NDArray[np.float32]:
    return np.random.default_rng(0).random((rows, columns)).astype(np.float32)


def matrix(name: str, rows: int, columns: int) -> Figure:
    pairs = np.array([[0, 1], [rows - 1, columns - 1]])
    paths = [AlignedPath(name, pairs), AlignedPath(f"other {name}", pairs[:1])]
    one, other = row(name, list(range(rows)), lost=0), row(name, list(range(100, 100 + columns)))
    return alignment_matrix(one, other, distances(rows, columns), paths, COLOURS, name, name)


def strip_figure(name: str, symbols: int) -> Figure:
    string = np.arange(symbols)
    starts = np.arange(symbols) / 3
    clip = StripOfSymbols(
        symbols / 3, standing(16), (np.arange(16) + 0.5) / 48 * symbols,
        string, np.maximum(0, starts), string, starts, standing(symbols),
    )  # fmt: skip
    return symbol_strip(clip, [], COLOURS, name, name)


def map_figure(name: str, count: int) -> Figure:
    random = np.random.default_rng(1)
    bodies = standing(count)
    bodies[0] = np.nan
    return posture_map(
        random.random((count, 2)), random.random(count), bodies, random.random((40, 2)),
        random.integers(0, count, 40), COLOURS[:count], name, name,
    )  # fmt: skip


def curves(name: str, count: int) -> Figure:
    recall = np.linspace(0.1, 1, 9)
    return precision_recall_figure({f"{name} {i}": (recall, 1 - recall / (2 + i)) for i in range(count)}, name, name)


def confusions(name: str, count: int) -> Figure:
    return confusion_figure(np.eye(count) * 7 + 1, [f"{name} {i}" for i in range(count)], name, name)


def robustness(name: str, count: int) -> Figure:
    return robustness_figure({f"{name} {i}": {0.0: [0.9, 0.8], 0.3: 0.5} for i in range(count)}, name, name)


DRAWINGS: list[Callable[[str], Figure]] = [
    lambda name: matrix(name, 2, 3),
    lambda name: matrix(name, 120, 40),
    lambda name: strip_figure(name, 2),
    lambda name: strip_figure(name, 70),
    lambda name: map_figure(name, 60),
    lambda name: curves(name, 1),
    lambda name: curves(name, 30),
    lambda name: confusions(name, 1),
    lambda name: confusions(name, 30),
    lambda name: robustness(name, 6),
]


@pytest.mark.parametrize("draw", DRAWINGS)
@pytest.mark.parametrize("name", ["clip", "".join(NASTY)], ids=["plain", "nasty"])
def test_pictures_of_strings_are_readable_whatever_things_are_called(draw: Callable[[str], Figure], name: str) -> None:
    assert_readable(draw(name))


def test_postures_of_features_are_the_bodies_they_were_made_from() -> None:
    """Joints come back where they were, seen from the body and in its lengths, however it stood and turned."""
    config = replace(PosturesConfig().frames, smoothing=0.0)
    body = rotate(from_axis_angle(np.array([0.0, 1.0, 0.0]), 70.0), standing(4)) + np.array([3.0, 0.0, -2.0])
    made = posture_bodies(word_features(body, np.zeros((4, 21, 4)), 30.0, config), config)
    assert made is not None
    own = standing(4)
    expected = (own - own[:, :1]) / body_length(own)
    common = [INDEX[name] for name in COMMON]
    np.testing.assert_allclose(made[:, common], expected[:, common], atol=1e-5)
    assert (made[:, INDEX["chest"], 1] > made[:, INDEX["spine"], 1]).all()
    view = postures_view(np.concatenate([made, made[:1] * np.nan]))
    assert (np.abs(view[:4, :, 1].min(axis=1)) < 1e-9).all()
    assert (view[:4, INDEX["head"], 1] > view[:4, INDEX["left_knee"], 1]).all()
    assert np.isnan(view[4]).all()


def test_rotations_are_no_joint_positions() -> None:
    assert posture_bodies(np.zeros((3, 64)), PosturesConfig.pesta().frames) is None


def test_symbols_strided_over_are_boxed_and_the_nearest_cells_are_lightest() -> None:
    cost = np.full((4, 5), 2.0, dtype=np.float32)
    cost[0, 1] = cost[2, 2] = cost[3, 4] = 0.0
    path = AlignedPath("hit", np.array([[0, 1], [2, 2], [3, 4]]))
    assert path.strided(0).tolist() == [1]
    assert path.strided(1).tolist() == [3]
    figure = alignment_matrix(row("a", [0, 1, 2, 3]), row("b", [4, 5, 6, 7, 8]), cost, [path], COLOURS, "title")
    dashed = [
        p
        for axes in figure.axes
        for p in axes.patches
        if isinstance(p, Rectangle) and p.get_linestyle() not in ("-", "solid")
    ]
    assert len(dashed) == 3  # one row, one column, the legend's
    images = [np.asarray(image.get_array()) for axes in figure.axes for image in axes.images]
    shade = next(image for image in images if image.shape[:2] == cost.shape).sum(axis=-1)
    assert (shade[cost == 0] > shade[cost > 0].max()).all()
    line = next(line for axes in figure.axes for line in axes.lines if len(np.asarray(line.get_xdata())) == 3)
    assert (np.diff(line.get_xdata()) > 0).all()
    assert (np.diff(line.get_ydata()) > 0).all()  # the sheet counts inches downwards


@pytest.mark.parametrize(
    ("runs", "kept", "expected"),
    [
        ([1, 2, 1, 2, 1, 2, 5], [0, 1, 6], [(4, 2)]),
        ([7, 1, 2, 3, 1, 2, 3], [0, 1, 2, 3], [(3, 3)]),
        ([1, 2, 3], [0, 1, 2], []),
        ([1, 2, 9, 8], [0, 1], [(2, None)]),
    ],
)
def test_folded_repeats_are_told_with_their_period(
    runs: list[int], kept: list[int], expected: list[tuple[int, int | None]]
) -> None:
    starts = np.maximum(0, (np.arange(len(runs)) * 3 - 0.5) / 30)
    string = np.array(runs)[kept]
    clip = StripOfSymbols(
        len(runs) / 10, standing(2), np.array([0.0, 0.1]),
        np.array(runs), starts, string, np.ceil(starts[kept] * 120) / 120, standing(len(string)),
    )  # fmt: skip
    found = folds(clip, 1 / 30)
    assert [(fold.symbols, fold.period) for fold in found] == expected
    for fold in found:
        assert 0 <= fold.start < fold.stop <= clip.seconds


def test_a_first_run_of_one_sample_is_not_folded() -> None:
    starts = np.maximum(0, (np.arange(3) - 0.5) / 30)  # the first lasts half as long as a sample
    runs = np.array([4, 5, 6])
    clip = StripOfSymbols(0.1, standing(2), np.array([0.0, 0.05]), runs, starts, runs, starts, standing(3))
    assert folds(clip, 1 / 30) == []


@pytest.fixture(scope="module")
def material(built_lake: Path) -> Iterator[SymbolMaterial]:
    lake = open_lake(built_lake)
    with reading(lake) as con:
        found = read_symbols(con, lake)
        for clip in range(len(found.strings.clips)):
            found.poses.positions(found.strings.clips[clip].clip)
        yield found


def test_a_strip_shows_the_clip_s_own_string(material: SymbolMaterial) -> None:
    strings = material.strings
    for clip, known in enumerate(strings.clips):
        drawn = strip_of(material, clip)
        assert drawn is not None
        found = folds(drawn, 1 / material.config.fps)
        folded = sum(fold.symbols for fold in found)
        assert len(drawn.runs) - folded == len(drawn.symbols) == strings.repository.lengths[clip]
        assert drawn.seconds == pytest.approx(known.frames / known.fps)
        assert (np.diff(drawn.run_starts) > 0).all()
    assert drawn is not None
    figure = symbol_strip(drawn, found, material.colours, "strip")
    assert_readable(figure)
    texts = [t.get_text() for t in figure.texts]
    assert f"string ({len(drawn.symbols)})" in texts
    assert sum(text == str(drawn.symbols[0]) for text in texts) >= 1


def test_the_sample_on_the_map_is_coded_as_the_lake_is(material: SymbolMaterial) -> None:
    from motionlake.pesta.dictionary import load_dictionary

    features, symbols = posture_sample(material, range(len(material.strings.clips)))
    assert len(features) == len(symbols) > 100
    file = query(material.lake.root, "SELECT file FROM models WHERE model = $model", model=material.strings.model)
    dictionary = load_dictionary(material.lake.path(file[0][0]))
    np.testing.assert_array_equal(dictionary.encode(features), symbols)
    np.testing.assert_array_equal(tsne(features[:60], 30.0), tsne(features[:60], 30.0))


def test_a_dictionary_over_rotations_is_drawn_as_moments_of_clips(material: SymbolMaterial) -> None:
    other = replace(material, config=PosturesConfig.pesta())
    strings = material.strings
    absent = len(material.codes)
    bodies = other.bodies(np.array([strings.repository.symbols[0], absent]))
    own = material.poses.positions(strings.clips[0].clip)[: strings.stops[0] + 4]
    assert np.abs(own - bodies[0]).max(axis=(1, 2)).min() == 0
    assert np.isnan(bodies[1]).all()


@pytest.mark.parametrize("boundaries", ["kept", "crossed"])
def test_paths_in_frames_are_the_symbols_of_the_alignment(built_lake: Path, boundaries: str) -> None:
    lake = open_lake(built_lake)
    searcher = AlignmentRangeSearcher(lake, paths=True, boundaries=boundaries)
    strings = searcher.strings
    clip = strings.clips[int(np.argmax(strings.repository.lengths))]
    query = Query(clip.clip, 3, clip.frames - 2)
    asked = searcher.symbols_of(query)
    (hits,) = searcher.search([query], 4)
    assert hits
    with reading(lake) as con:
        material = read_symbols(con, lake, strings)
        pictures = AlignmentPictures(material, asked, clip.fps, searcher.config, searcher.clip_strings)
        for hit in hits:
            columns = pictures.around(hit)
            pairs = path_indices(columns, asked, hit)
            assert (pairs[0, 0], pairs[-1, 0]) == (0, len(asked.symbols) - 1)
            assert (np.diff(pairs, axis=0) >= 0).all()
            assert columns.starts[pairs[0, 1]] == hit.start
            assert hit.stop in columns.stops[pairs[-1, 1] :]
            matched = columns.symbols[pairs[:, 1]]
            least = strings.distances.matrix[asked.symbols[pairs[:, 0]], matched].sum()
            assert least <= (hit.cost or 0.0) + 1e-3
        with pytest.raises(ValueError, match="no path"):
            path_indices(columns, asked, replace(hits[0], path=None))
        warped = pictures.compared(asked.symbols, 5)  # with itself: along the diagonal
        assert [path.compared for path in warped] == [True]
        assert warped[0].pairs.tolist() == [[place, place + 5] for place in range(len(asked.symbols))]
        assert not replace(pictures, config=replace(searcher.config, method="dtw")).compared(asked.symbols, 0)


def test_answers_of_align_are_drawn(built_lake: Path, clips_folder: Path, tmp_path: Path) -> None:
    clip = query(built_lake, "SELECT clip FROM symbol_strings ORDER BY -len(symbols), clip LIMIT 1")[0][0]
    ask = ["align", clip, "-k", 3, "--lake", built_lake, "--json"]
    plain = motionlake(*ask)
    drawn = motionlake(*ask, "--picture", tmp_path / "hits.html")
    assert (drawn.status, drawn.out) == (0, plain.out)
    page = assert_self_contained((tmp_path / "hits.html").read_text(encoding="utf-8"))
    assert len(page.images) == 1 + len(plain.json)
    assert any(f"cost {plain.json[0]['cost']:.3f}" in text for text in page.texts)
    file = clips_folder / clip.partition("/")[2]
    asked: list[list[Any]] = [["--picture", tmp_path / "one.png"], ["--whole", "--picture", tmp_path / "whole.png"]]
    for words in asked:
        assert motionlake("align", file, *words, "--lake", built_lake).status == 0
        assert words[-1].read_bytes().startswith(b"\x89PNG")
    wrong = motionlake(*ask, "--picture", tmp_path / "hits.gif")
    assert (wrong.status, wrong.out) == (2, "")
    assert ".png or .html" in wrong.err


def test_a_report_shows_the_strings_where_there_are_such(
    built_lake: Path, lake: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("motionlake.pictures.symbol_pictures.SAMPLED", 200)  # soon placed

    made = motionlake("report", "--lake", built_lake, "--out", tmp_path / "with.html", "--json")
    names = [row["name"] for row in made.json["pictures"]]
    assert {"dictionary", "alignment"} <= set(names)
    assert sum(name.startswith("strip-") for name in names) >= 1
    with Changed(lake) as con:
        con.execute("DELETE FROM postures")
    without = motionlake("report", "--lake", lake, "--out", tmp_path / "without.html", "--json")
    assert without.status == 0, without.err
    assert not {"dictionary", "alignment"} & {row["name"] for row in without.json["pictures"]}


def test_numbers_of_the_figures_are_those_given() -> None:
    figure = confusion_figure([[3, 1], [0, 0]], ["a", "b"])
    texts = [t.get_text() for t in figure.texts]
    assert texts.count("75") == texts.count("25") == 1
    lines = precision_recall_figure({"a": ([0.5, 1], [1, 0.5]), "b": ([0.5, 1], [0.5, 0])}).axes[0].lines
    mean = max(lines, key=lambda line: line.get_linewidth())
    np.testing.assert_allclose(np.asarray(mean.get_ydata())[[0, -1]], [0.75, 0.25])
    line = robustness_figure({"sta": {0.2: [0.4, 0.6], 0.0: 0.9}}).axes[0].lines[0]
    np.testing.assert_allclose(np.asarray(line.get_xdata()), [0, 20])
    np.testing.assert_allclose(np.asarray(line.get_ydata()), [0.9, 0.5])


@pytest.mark.parametrize(
    ("draw", "complaint"),
    [
        (lambda: precision_recall_figure({}), "no curves"),
        (lambda: precision_recall_figure({"a": ([0, 1], [1])}), "a: recall"),
        (lambda: precision_recall_figure({"a": ([1, 0], [1, 1])}), "falls"),
        (lambda: confusion_figure(np.ones((2, 3)), ["a", "b"]), "does not fit 2 classes"),
        (lambda: confusion_figure([[-1]], ["a"]), "negative"),
        (lambda: robustness_figure({"sta": {}}), "no rates"),
    ],
)
def test_data_that_cannot_be_drawn_is_named(draw: Callable[[], Figure], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        draw()

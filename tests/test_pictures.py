"""Pictures show what the lake holds, can be read, and need nothing from elsewhere."""

from __future__ import annotations

import base64
import io
import warnings
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake
from motionlake.motion.rotations import from_axis_angle, rotate
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS
from motionlake.pictures.bands import (
    MotifBand,
    QueryCurve,
    Segment,
    lanes_of,
    motif_bands,
    segment_bands,
    similarity_along,
    word_edges,
)
from motionlake.pictures.clip_sections import bars
from motionlake.pictures.hits_page import HitStrip, draw_hits, hits_page
from motionlake.pictures.html import page, picture
from motionlake.pictures.maps import clip_map, plane_of
from motionlake.pictures.material import dataset_view, discriminative, read_material, sampled, shares
from motionlake.pictures.motif_figures import (
    MotifRow,
    WordStrip,
    bar_colours,
    contact_sheet,
    motif_order,
    signature_bars,
)
from motionlake.pictures.report import make_report
from motionlake.pictures.sequence_sections import agreement
from motionlake.pictures.stick_figures import three_quarter_view
from motionlake.pictures.style import DPI, NONE, class_styles, fitted, plain, png, width_of
from numpy.typing import NDArray

from tests.lakes import Changed, motionlake, query

NASTY = ["a", '<b>&"quoted"\'', "$\\frac$ 1_^", "動き🙂\tand\nlines", "long_" * 40, " ", "esc\x1b[2J\u202e\0"]
LIMBS = {
    "spine": (0, 0.15, 0), "chest": (0, 0.2, 0), "neck": (0, 0.2, 0), "head": (0, 0.15, 0),
    "clavicle": (0.05, 0.15, 0), "shoulder": (0.12, 0, 0), "elbow": (0.28, 0, 0), "wrist": (0.25, 0, 0),
    "hip": (0.1, 0, 0), "knee": (0, -0.45, 0), "ankle": (0, -0.45, 0), "toe": (0, -0.05, 0.18),
}  # fmt: skip


def standing(count: int = 5) -> NDArray[np.float64]:
    """[count, 21, 3] a body that faces +z, its arms spread."""
    body = np.zeros((len(JOINTS), 3))
    body[0] = 0, 0.95, 0
    for i, (name, parent) in enumerate(zip(JOINTS, PARENTS, strict=True)):
        if parent >= 0:
            side = -1 if name.startswith("right") else 1
            body[i] = body[parent] + np.array(LIMBS[name.rpartition("_")[2]]) * (side, 1, 1)
    return np.asarray(np.repeat(body[None], count, axis=0))


def signatures(count: int, k: int, seed: int = 0) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    weights = rng.random((count, k)) * (rng.random((count, k)) < 0.4)
    weights[:, 0] += 0.01
    return np.asarray(weights / weights.sum(axis=1, keepdims=True), dtype=np.float32)


def bars_of(names: list[str]) -> Figure:
    groups = {name: dict(zip([name, "clip"], signatures(2, 9), strict=True)) for name in names}
    return signature_bars(groups, np.arange(9), names[-1], names[0])


def map_of(names: list[str]) -> Figure:
    points = np.random.default_rng(0).random((len(names), 2))
    return clip_map(points, names, names[-1], names[0], (names[-1], points * 0))


def bands_of(names: list[str]) -> Figure:
    bands = [MotifBand(n, np.arange(7) % 3, np.arange(8) / 2, signatures(1, 3)[0]) for n in names]
    return motif_bands(bands, np.arange(3), names[-1], names[0])


def segments_of(names: list[str]) -> Figure:
    truth = [Segment(i, i + 1.5, name) for i, name in enumerate([*names, "unknown"])]
    return segment_bands(dict.fromkeys(names[:3], truth), len(names) + 2.0, names[-1], names[0])


def similarity_of(names: list[str]) -> Figure:
    curves = [QueryCurve(n, standing(), np.linspace(0.0, 2.0, 9), np.arange(0.5, 9.0)) for n in names[:3]]
    truth = [Segment(i, i + 1.5, name) for i, name in enumerate(names)]
    return similarity_along(curves, len(names) + 9.0, names[-1], names[0], truth)


def sheet_of(names: list[str]) -> Figure:
    words = [WordStrip(n, ", 1.0–1.7 s", standing()) for n in names[:3]]
    rows = [MotifRow(7, n, np.array([0.1, 0.2, 0.3]), words, dict.fromkeys(names, 0.1)) for n in names]
    return contact_sheet(rows, names[-1], names[0], "share")


def hits_of(names: list[str]) -> Figure:
    rows = [HitStrip(str(i), [n, n, n], standing(14)) for i, n in enumerate(names)]
    return draw_hits(rows[0], rows[1:], names[-1], names[0])


DRAWINGS = [bars_of, map_of, bands_of, segments_of, similarity_of, sheet_of, hits_of]


def assert_readable(figure: Figure) -> None:
    """It draws without a warning; no text lies on another one, none leaves the page."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        image = imread(io.BytesIO(png(figure)))
    assert image.std() > 0
    figure.set_dpi(DPI)
    boxes = [t.get_window_extent() for t in figure.texts if t.get_text().strip()]
    x0, y0, x1, y1 = np.array([b.extents for b in boxes]).T
    assert x0.min() >= 0
    assert y0.min() >= 0
    assert x1.max() <= figure.bbox.width
    assert y1.max() <= figure.bbox.height
    across = np.minimum(x1[:, None], x1) - np.maximum(x0[:, None], x0)
    down = np.minimum(y1[:, None], y1) - np.maximum(y0[:, None], y0)
    # Boxes hold ascenders and descenders that most lines lack: they may touch by a pixel or two.
    over = np.argwhere(np.triu((across > 1) & (down > 3), 1))
    texts = [t.get_text() for t in figure.texts if t.get_text().strip()]
    assert not len(over), [(texts[i], texts[j]) for i, j in over[:3]]


@pytest.mark.parametrize("draw", DRAWINGS)
@pytest.mark.parametrize("names", [["one"], NASTY], ids=["one", "nasty"])
def test_pictures_are_readable_whatever_things_are_called(
    draw: Callable[[list[str]], Figure], names: list[str]
) -> None:
    assert_readable(draw(names))


@pytest.mark.parametrize("draw", [bars_of, map_of, segments_of])
def test_pictures_of_many_classes_are_readable(draw: Callable[[list[str]], Figure]) -> None:
    assert_readable(draw([f"class number {i}" for i in range(63)]))


@settings(max_examples=40, deadline=None)
@given(st.text(max_size=80), st.floats(0.3, 3), st.floats(6, 12))
def test_texts_are_cut_to_their_room_and_keep_both_ends(text: str, inches: float, size: float) -> None:
    cut = fitted(text, inches, size)
    assert width_of(cut, size) <= inches
    if "…" in cut and "…" not in text:
        head, tail = cut.split("…")
        assert plain(text).startswith(head)
        assert plain(text).endswith(tail)
        assert 0 <= len(head) - len(tail) <= 1


def test_bars_have_the_colours_of_the_lake_s_signatures(built_lake: Path) -> None:
    with reading(open_lake(built_lake)) as con:
        material = read_material(con, open_lake(built_lake))
        view = dataset_view(material, "clips")
        found = bars(material, view)
        groups = {
            name: dict(zip(material.names(clips), material.signatures[clips], strict=True))
            for name, clips in view.by_class().items()
        }
    assert "class" in found.title
    stored = dict(query(built_lake, "SELECT clip, signature FROM signatures"))
    figure = signature_bars(groups, material.order, "bars")
    blocks = [np.asarray(image.get_array()) for axes in figure.axes for image in axes.images]
    rows = np.concatenate([block[::12] for block in blocks if len(block) > 1])
    clips = [clip for group in groups.values() for clip in group]
    assert len(rows) == len(clips) == len(stored)
    for clip, row in zip(clips, rows, strict=True):
        expected = bar_colours(np.array(stored[clip])[material.order])
        np.testing.assert_allclose(row, expected, atol=1e-6)
        shown = np.abs(row - to_rgb(NONE)).max(axis=1) > 1e-3
        assert (shown == (np.array(stored[clip])[material.order] > 0)).all()


def test_motif_sheets_show_the_words_closest_to_the_centroid(built_lake: Path) -> None:
    """Against a naive search through all embeddings, and counts of all words."""
    with reading(open_lake(built_lake)) as con:
        material = read_material(con, open_lake(built_lake))
        view = dataset_view(material, "clips")
        found = material.nearest_words([0, 1], sorted(material.corpus.positions))
        common = shares(material, view)
    words = query(
        built_lake,
        "SELECT clip, word, motif, start, stop, embedding, label FROM embeddings JOIN words USING (clip, word) "
        "JOIN word_motifs USING (clip, word) JOIN clips USING (clip)",
    )
    for motif in (0, 1):
        ranked = sorted(
            (float(np.linalg.norm(np.array(embedding) - material.corpus.centroids[motif])), clip, start, stop)
            for clip, _, own, start, stop, embedding, _ in words
            if own == motif
        )
        first = {clip: (clip, start, stop) for _, clip, start, stop in reversed(ranked)}
        expected = [first[clip] for clip in dict.fromkeys(clip for _, clip, _, _ in ranked)]
        assert [(w.clip, w.start, w.stop) for w in found[motif]] == expected
    for label, share in common.items():
        motifs = [motif for _, _, motif, _, _, _, own in words if own == label]
        np.testing.assert_allclose(share, np.bincount(motifs, minlength=len(share)) / len(motifs))


def test_agreement_is_a_share_of_the_labelled_time() -> None:
    truth = [Segment(0, 1, "a"), Segment(0.5, 1, "c"), Segment(1, 2, "b"), Segment(3, 4, "a")]
    assert agreement(truth, [Segment(0, 2, "a"), Segment(2, 4, "unknown")]) == pytest.approx(1 / 3)
    assert agreement(truth, truth) == 1


def test_hotter_is_more_and_for_every_eye() -> None:
    lightness = bar_colours(np.geomspace(0.005, 0.5, 50)) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(lightness) < 0).all()
    assert (bar_colours(np.array([0.0])) == to_rgb(NONE)).all()


def test_similar_motifs_stand_side_by_side() -> None:
    line = np.random.default_rng(0).permutation(20)
    order = motif_order(np.stack([line, 0 * line], axis=1).astype(float))
    assert line[order].tolist() in (list(range(20)), list(range(19, -1, -1)))


def test_a_map_keeps_distances_that_a_plane_can_hold() -> None:
    points = np.random.default_rng(1).normal(size=(15, 2))
    distances = np.linalg.norm(points[:, None] - points[None], axis=-1)
    found, stress = plane_of(distances)
    np.testing.assert_allclose(np.linalg.norm(found[:, None] - found[None], axis=-1), distances, atol=1e-6)
    assert stress < 1e-6
    assert plane_of(np.zeros((4, 4)))[1] == 0
    points = np.random.default_rng(1).normal(size=(15, 5))
    assert plane_of(np.linalg.norm(points[:, None] - points[None], axis=-1))[1] > 0.05


@given(st.lists(st.tuples(st.integers(0, 30), st.integers(1, 9)), max_size=25))
def test_overlapping_segments_lie_in_as_few_lanes_as_can_be(spans: list[tuple[int, int]]) -> None:
    segments = [Segment(start, start + length, "x") for start, length in spans]
    lanes = lanes_of(segments)
    for i, a in enumerate(segments):
        for j, b in enumerate(segments[:i]):
            assert lanes[i] != lanes[j] or a.stop <= b.start or b.stop <= a.start
    deepest = max((sum(s.start <= t < s.stop for s in segments) for t in range(40)), default=0)
    assert max(lanes, default=-1) + 1 == deepest


def test_words_share_a_clip_without_gaps() -> None:
    edges = word_edges(np.array([0, 20, 40]), np.array([80, 100, 120]), 120.0)
    np.testing.assert_allclose(edges * 120, [0, 50, 70, 120])


@given(st.floats(-180, 180), st.floats(-9, 9), st.floats(-9, 9))
def test_bodies_face_the_same_way_wherever_they_stood(degrees: float, x: float, z: float) -> None:
    turn = from_axis_angle(np.array([0.0, 1.0, 0.0]), degrees)
    moved = rotate(turn, standing()) + np.array([x, 0.0, z])
    view = three_quarter_view(moved)
    np.testing.assert_allclose(view, three_quarter_view(standing()), atol=1e-4)
    toe, ankle = view[0, INDEX["left_toe"]], view[0, INDEX["left_ankle"]]
    assert toe[0] > ankle[0]  # to the viewer's right, and towards the viewer
    assert toe[2] < ankle[2]
    assert view[0, INDEX["right_wrist"], 0] < view[0, INDEX["left_wrist"], 0]


def test_samples_do_not_hang_on_the_order_of_clips() -> None:
    names = [f"clip {i}" for i in range(200)]
    other = list(reversed(names))
    chosen = {names[i] for i in sampled(names, 17)}
    assert chosen == {other[i] for i in sampled(other, 17)}
    assert len(chosen) == 17
    assert len(sampled(names[:5], 17)) == 5


def test_the_motif_of_a_class_is_common_in_it_and_rare_elsewhere() -> None:
    common = {"a": np.array([0.6, 0.35, 0.0, 0.05]), "b": np.array([0.6, 0.0, 0.4, 0.0])}
    assert discriminative(common) == [("a", 1), ("b", 2)]  # both are mostly motif 0


def test_classes_differ_in_colour_marker_or_hatch() -> None:
    styles = class_styles([str(i) for i in range(63)])
    assert len({(s.colour, s.marker) for s in styles.values()}) == 63
    assert len({(s.colour, s.hatch) for s in styles.values()}) == 63


class Page(HTMLParser):
    """What a page asks for, and its texts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.images: list[bytes] = []
        self.tags: set[str] = set()
        self.texts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        for name, value in attrs:
            if name == "src":
                kind, _, data = (value or "").partition(",")
                assert (tag, kind) == ("img", "data:image/png;base64")
                self.images.append(base64.b64decode(data, validate=True))
            assert name != "href" or (value or "").startswith("#")
            assert not name.startswith("on")

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def assert_self_contained(text: str) -> Page:
    found = Page(text)
    assert not found.tags & {"script", "link", "iframe", "object", "base"}
    assert "url(" not in text
    assert "@import" not in text
    for image in found.images:
        assert imread(io.BytesIO(image)).ndim == 3
    return found


def test_names_are_escaped_in_a_page() -> None:
    made = picture(NASTY[1], NASTY[1], NASTY[1], Figure((1, 1)))
    text = page(NASTY[1], [NASTY[1]], [[{NASTY[1]: NASTY[1]}]], {NASTY[1]: [made]})
    found = assert_self_contained(text)
    assert "b" not in found.tags
    assert found.texts.count(NASTY[1]) == 7
    assert len(found.images) == 1


@pytest.fixture
def small_map(monkeypatch: pytest.MonkeyPatch) -> None:
    """A report whose map of postures is soon placed; that of tests/test_readme.py is whole."""
    monkeypatch.setattr("motionlake.pictures.symbol_pictures.SAMPLED", 200)


@pytest.mark.usefixtures("small_map")
def test_a_report_shows_the_lake(built_lake: Path, tmp_path: Path) -> None:
    out, folder = tmp_path / "made" / "report.html", tmp_path / "pictures"
    run = motionlake("report", "--lake", built_lake, "--out", out, "--pictures", folder, "--json")
    assert run.status == 0, run.err
    found = assert_self_contained(out.read_text(encoding="utf-8"))
    names = [row["name"] for row in run.json["pictures"]]
    assert len(set(names)) == len(names) == len(found.images)
    assert {"clips-signatures", "clips-map", "clips-motifs-1", "clips-bands", "search"} <= set(names)
    assert [(folder / f"{name}.png").read_bytes() for name in names] == found.images
    clips, minutes = query(built_lake, "SELECT count(*), sum(seconds) / 60 FROM clips")[0]
    assert found.texts.count(str(clips)) >= 1
    assert f"{minutes:.1f}" in found.texts
    again = motionlake("report", "--lake", built_lake, "--out", tmp_path / "again.html")
    assert again.out.split() == ["wrote", str(tmp_path / "again.html")]
    assert (tmp_path / "again.html").read_bytes() == out.read_bytes()


@pytest.mark.usefixtures("small_map")
def test_a_report_without_labels_shows_clusters(lake: Path) -> None:
    with Changed(lake) as con:
        con.execute("UPDATE clips SET label = NULL, subject = NULL")
    with reading(open_lake(lake)) as con:
        made = make_report(con, open_lake(lake))
    assert any("each cluster" in p.title for p in made.pictures)
    assert "no labels" in made.html


@pytest.mark.parametrize("kept", [1, 2])
def test_a_report_of_hardly_any_clips(lake: Path, kept: int) -> None:
    with Changed(lake) as con:
        con.execute("CREATE TEMP TABLE kept AS SELECT clip FROM clips ORDER BY clip LIMIT $kept", {"kept": kept})
        con.execute("UPDATE clips SET label = $label", {"label": NASTY[1]})
        con.execute("INSERT INTO segments SELECT clip, 0, frames // 2, $label FROM clips", {"label": NASTY[2]})
        for table in ("clips", "words", "word_motifs", "signatures", "segments"):
            con.execute(f"DELETE FROM {table} WHERE clip NOT IN (FROM kept)")
    with reading(open_lake(lake)) as con, warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        made = make_report(con, open_lake(lake))
    assert_self_contained(made.html)
    names = [p.name for p in made.pictures]
    assert ("search" in names) == (kept == 2)
    assert "clips-map" not in names
    assert any("segments" in name for name in names)


def test_hits_of_a_search_and_of_a_file(built_lake: Path, clips_folder: Path, tmp_path: Path) -> None:
    clip = query(built_lake, "SELECT clip FROM clips ORDER BY clip LIMIT 1")[0][0]
    out = tmp_path / "hits.html"
    file = clips_folder / clip.partition("/")[2]
    run = motionlake("search", clip, file, "-k", "3", "--lake", built_lake, "--picture", out, "--json")
    assert run.status == 0, run.err
    assert len(assert_self_contained(out.read_text(encoding="utf-8")).images) == 2
    rows = [row for row in run.json if row["query"] == clip]
    with reading(open_lake(built_lake)) as con:
        figure = hits_page(con, open_lake(built_lake), clip, [{**rows[0], "start": 3, "stop": 9}, *rows[1:]], 2, 12)
    assert_readable(figure)
    texts = [t.get_text() for t in figure.texts]
    for row in rows:
        assert str(row["rank"]) in texts
        assert any(f"distance {row['distance']:.3f}" in text for text in texts)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["report", "--out", "report.pdf"], "written as .html"),
        (["report", "--dataset", "elsewhere"], "no clip with a signature"),
        (["report", "--out", "folder.html"], "cannot be written"),
        (["search", "--sample", "2", "--picture", "x.png"], "one query"),
        (["search", "--sample", "1", "--picture", "x.gif"], ".png or .html"),
    ],
)
def test_what_cannot_be_drawn_is_one_clear_line(
    built_lake: Path, tmp_path: Path, words: list[str], complaint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.html").mkdir()
    run = motionlake(*words, "--lake", built_lake)
    assert run.status == 2
    assert complaint in run.err
    assert [p.name for p in tmp_path.iterdir()] == ["folder.html"]


def test_a_lake_without_motifs_has_no_report(tmp_path: Path) -> None:
    assert motionlake("init", tmp_path / "lake").status == 0
    run = motionlake("report", "--lake", tmp_path / "lake", "--out", tmp_path / "report.html")
    assert run.status == 2
    assert "motionlake run all" in run.err

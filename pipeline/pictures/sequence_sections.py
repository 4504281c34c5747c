"""The pictures of a report that show sequences: where queries occur, and what is done when."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.deep_motifs.query_by_example import ExampleQuery, distances_along, window_ranges
from motionlake.deep_motifs.segmentation import (
    LabelledRange,
    SegmentationConfig,
    Segmenter,
    bands,
    labelled_windows,
    word_centres,
)
from motionlake.pictures.bands import QueryCurve, Segment, segment_bands, similarity_along
from motionlake.pictures.html import Picture, picture
from motionlake.pictures.material import Material, View, Word
from motionlake.pictures.stick_figures import spread

QUERY_WORDS: Final = 5
QUERIES: Final = 3
POSES: Final = 5
LONG: Final = 40  # words of a clip worth looking along
TEACHERS: Final = 60
CHECKS: Final = 20.0  # a second, at which found classes are compared with labelled ones


def along(material: Material, view: View) -> Picture | None:
    """How near up to three short queries are to each moment of the longest clip (figure 11)."""
    corpus = material.corpus
    target, queries = _along_choice(material, view)
    if not queries:
        return None
    curves = []
    for what, clip, first in queries:
        words = slice(corpus.words_of(clip).start + first, corpus.words_of(clip).start + first + QUERY_WORDS)
        word = Word(corpus.clips[clip].clip, int(corpus.starts[words][0]), int(corpus.stops[words][-1]))
        poses = spread(material.poses.positions(word.clip)[word.start : word.stop], POSES)
        middles = window_ranges(corpus, target, QUERY_WORDS).mean(axis=1) / corpus.clips[target].fps
        distances = distances_along(corpus, target, ExampleQuery(corpus.motifs[words]))
        curves.append(QueryCurve(f"{what}: {''.join(material.source(word))}", poses, distances, middles))
    name = material.short_names(view.clips)[view.clips.tolist().index(target)]
    queries_in = f"{len(curves)} short queries occur" if len(curves) > 1 else "a short query occurs"
    title = f"{view.name}: where {queries_in} in {name}"
    note = f"queries of {QUERY_WORDS} words, Earth Mover's Distance from each window of as many; {material.about_model}"
    caption = (
        "Query by example (Deep Motifs, figure 11). On the left the queries, five words each, from other clips "
        "where there are such. On the right the distance of each moment's signature from the query's: the higher the "
        "curve and the darker the band, the nearer."
    )
    truth = material.segments.get(corpus.clips[target].clip, ())
    figure = similarity_along(curves, material.seconds(target), title, note, truth, _classes(material, view))
    return picture(f"{view.name}-along", title, caption, figure)


def _along_choice(material: Material, view: View) -> tuple[int, list[tuple[str, int, int]]]:
    """The sequence to look in, and (what, clip, first word) of the queries, from other clips of other classes."""
    lengths = np.diff(material.corpus.offsets)
    clips = view.clips.tolist()
    labelled = [i for i, name in zip(clips, material.names(clips), strict=True) if name in material.segments]
    target = max(labelled or clips, key=lambda i: (lengths[i], -i))
    if lengths[target] < LONG:
        return target, []
    if labelled:
        return target, _labelled_queries(material, view, target)
    by_class = view.by_class()
    own = view.classes[clips.index(target)]
    queries = []
    for name in [own, *(n for n in by_class if n != own)]:
        others = [i for i in by_class[name] if i != target and lengths[i] >= QUERY_WORDS]
        queries += [(name, i, (int(lengths[i]) - QUERY_WORDS) // 2) for i in material.some(others, 1)]
    return target, queries[:QUERIES]


def _labelled_queries(material: Material, view: View, target: int) -> list[tuple[str, int, int]]:
    """From the middle of labelled segments, of other clips where there are such, of classes the sequence holds."""
    corpus = material.corpus
    wanted = {s.label for s in material.segments[corpus.clips[target].clip]}
    found: dict[str, tuple[bool, float, int, int]] = {}
    for i in view.clips.tolist():
        known, words = corpus.clips[i], corpus.words_of(i)
        middles = (corpus.starts[words] + corpus.stops[words]) / 2 / known.fps
        for segment in material.segments.get(known.clip, ()):
            first = int(np.abs(middles - (segment.start + segment.stop) / 2).argmin()) - QUERY_WORDS // 2
            if segment.label in wanted and 0 <= first <= len(middles) - QUERY_WORDS:
                key = (i == target, segment.start - segment.stop, i, first)
                found[segment.label] = min(found.get(segment.label, key), key)
    ranked = sorted(found.items(), key=lambda f: (f[1], f[0]))[:QUERIES]
    return [(label, clip, first) for label, (_, _, clip, first) in ranked]


def most_cut(material: Material, view: View, count: int) -> list[int]:
    """At most `count` clips (corpus indices) with labelled segments: those of most labels, then most segments."""

    def key(clip: int) -> tuple[int, int, int]:
        segments = material.segments[material.corpus.clips[clip].clip]
        return -len({s.label for s in segments}), -len(segments), clip

    labelled = [i for i in view.clips.tolist() if material.corpus.clips[i].clip in material.segments]
    return sorted(labelled, key=key)[:count]


def segmentation(material: Material, view: View, clip: int) -> Picture:
    """The labelled segments of a clip, and below them those that other clips' segments teach (figure 13)."""
    name = material.corpus.clips[clip].clip
    truth = material.segments[name]
    found, taught = _found_segments(material, view, clip)
    rows: dict[str, Sequence[Segment]] = {"labelled": truth}
    note = "labelled segments"
    caption = "Segments in time (Deep Motifs, figure 13): the labelled truth."
    if found:
        rows["found by signatures"] = found
        known = [s for s in truth if s.label in taught]
        note = f"{agreement(known, found):.0%} of the time of classes that other clips teach is found right"
        untaught = sorted({s.label for s in truth} - taught)
        note += f"; none teaches {', '.join(untaught)}" if untaught else ""
        note += f"; {material.about_model}"
        caption = (
            "Segments in time (Deep Motifs, figure 13). Above the labelled truth, below what the signatures of "
            "sliding windows say, learned from the other labelled clips of the dataset; hatched grey is unknown."
        )
    (file,) = material.short_names([clip])
    title = f"{view.name}: what is done when in {file}"
    figure = segment_bands(rows, material.seconds(clip), title, note, _classes(material, view))
    return picture(f"{view.name}-segments-{file}", title, caption, figure)


def _classes(material: Material, view: View) -> list[str]:
    """Every class of the view's segments, by name."""
    return sorted({s.label for clip in material.names(view.clips) for s in material.segments.get(clip, ())})


def _found_segments(material: Material, view: View, clip: int) -> tuple[list[Segment], set[str]]:
    """What other clips of the view teach of a clip, and the classes taught; nothing where none is the clip's."""
    corpus = material.corpus
    known = corpus.clips[clip]
    others = [i for i in view.clips.tolist() if i != clip and corpus.clips[i].clip in material.segments]
    ranges = [
        LabelledRange(i, round(s.start * corpus.clips[i].fps), round(s.stop * corpus.clips[i].fps), s.label)
        for i in material.some(others, TEACHERS)
        for s in material.segments[corpus.clips[i].clip]
    ]
    taught = {r.label for r in ranges}
    if not taught & {s.label for s in material.segments[known.clip]}:
        return [], taught
    config = SegmentationConfig()
    segmenter = Segmenter(labelled_windows(corpus, ranges, config.window), corpus.ground, config)
    labels = segmenter.label_words(corpus.motifs[corpus.words_of(clip)], corpus.idf)
    found = bands(labels, word_centres(corpus, clip), known.frames)
    return [Segment(band.start / known.fps, band.stop / known.fps, band.label) for band in found], taught


def agreement(truth: Sequence[Segment], found: Sequence[Segment]) -> float:
    """Share of the labelled time at which what was found is one of the labels."""
    times = np.arange(0, max(s.stop for s in truth), 1 / CHECKS)
    labelled, right = 0, 0
    for time in times:
        labels = {s.label for s in truth if s.start <= time < s.stop}
        labelled += bool(labels)
        right += any(s.label in labels for s in found if s.start <= time < s.stop)
    return right / max(labelled, 1)

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
from motionlake.pictures.bands import Segment, SegmentRow, segment_bands
from motionlake.pictures.html import Picture, model, picture, source
from motionlake.pictures.material import Material, View, Word, display_names, sampled
from motionlake.pictures.signatures import QueryCurve, similarity_along

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
    if target is None or not queries:
        return None
    curves = []
    fps = corpus.clips[target].fps
    for name, clip, first in queries:
        words = slice(corpus.words_of(clip).start + first, corpus.words_of(clip).start + first + QUERY_WORDS)
        query = ExampleQuery(corpus.motifs[words])
        poses = material.poses.sample(
            corpus.clips[clip].clip, int(corpus.starts[words][0]), int(corpus.stops[words][-1]), POSES
        )
        middles = window_ranges(corpus, target, QUERY_WORDS).mean(axis=1) / fps
        curves.append(QueryCurve(name, poses, distances_along(corpus, target, query), middles))
    name = display_names([corpus.clips[i].clip for i in view.clips])[view.clips.tolist().index(target)]
    queries_in = f"{len(curves)} short queries occur" if len(curves) > 1 else "a short query occurs"
    title = f"{view.name}: where {queries_in} in {name}"
    note = f"queries of {QUERY_WORDS} words, Earth Mover's Distance from each window of as many; {model(material)}"
    caption = (
        "Query by example (Deep Motifs, figure 11). On the left the queries, five words each, from other clips "
        "where there are such. On the right the distance of each moment's signature from the query's: the higher the "
        "curve and the darker the band, the nearer."
    )
    truth = material.segments.get(corpus.clips[target].clip, ())
    figure = similarity_along(curves, material.seconds(target), title, note, truth, _classes(material, view))
    return picture(f"{view.name}-along", title, caption, figure)


def segmentation(material: Material, view: View, clip: int) -> Picture:
    """The labelled segments of a clip, and below them those that other clips' segments teach (figure 13)."""
    name = material.corpus.clips[clip].clip
    truth = material.segments[name]
    found, taught = _found_segments(material, view, clip)
    rows = [SegmentRow("labelled", truth)]
    note = "labelled segments"
    caption = "Segments in time (Deep Motifs, figure 13): the labelled truth."
    if found:
        rows.append(SegmentRow("found by signatures", found))
        known = [s for s in truth if s.label in taught]
        note = f"{agreement(known, found):.0%} of the time of classes that other clips teach is found right"
        untaught = sorted({s.label for s in truth} - taught)
        note += f"; none teaches {', '.join(untaught)}" if untaught else ""
        note += f"; {model(material)}"
        caption = (
            "Segments in time (Deep Motifs, figure 13). Above the labelled truth, below what the signatures of "
            "sliding windows say, learned from the other labelled clips of the dataset; hatched grey is unknown."
        )
    title = f"{view.name}: what is done when in {display_names([name])[0]}"
    figure = segment_bands(rows, material.seconds(clip), title, note, _classes(material, view))
    return picture(f"{view.name}-segments-{display_names([name])[0]}", title, caption, figure)


def _classes(material: Material, view: View) -> list[str]:
    """Every class of the view's segments, by name."""
    clips = (material.corpus.clips[i].clip for i in view.clips)
    return sorted({s.label for clip in clips for s in material.segments.get(clip, ())})


def _found_segments(material: Material, view: View, clip: int) -> tuple[list[Segment], set[str]]:
    """What other clips of the view teach of a clip, and the classes taught; nothing where none is the clip's."""
    corpus = material.corpus
    others = [i for i in view.clips.tolist() if i != clip and corpus.clips[i].clip in material.segments]
    others = [others[i] for i in sampled([corpus.clips[i].clip for i in others], TEACHERS)]
    ranges = [
        LabelledRange(i, round(s.start * corpus.clips[i].fps), round(s.stop * corpus.clips[i].fps), s.label)
        for i in others
        for s in material.segments[corpus.clips[i].clip]
    ]
    taught = {r.label for r in ranges}
    if not taught & {s.label for s in material.segments[corpus.clips[clip].clip]}:
        return [], taught
    config = SegmentationConfig()
    segmenter = Segmenter(labelled_windows(corpus, ranges, config.window), corpus.ground, config)
    labels = segmenter.label_words(corpus.motifs[corpus.words_of(clip)], corpus.idf)
    known = corpus.clips[clip]
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


def _along_choice(material: Material, view: View) -> tuple[int | None, list[tuple[str, int, int]]]:
    """The sequence to look in, and (name, clip, first word) of the queries, from other clips of other classes."""
    corpus = material.corpus
    names = [corpus.clips[i].clip for i in view.clips]
    lengths = np.array([corpus.offsets[i + 1] - corpus.offsets[i] for i in view.clips])
    labelled = np.array([name in material.segments for name in names])
    candidates = np.flatnonzero(labelled) if labelled.any() else np.arange(len(names))
    best = candidates[np.argmax(lengths[candidates])]
    if lengths[best] < LONG:
        return None, []
    target = int(view.clips[best])
    if labelled.any():
        return target, _labelled_queries(material, view, target)
    queries: list[tuple[str, int, int]] = []
    by_class = view.by_class()
    own = view.classes[best]
    for name in [own, *(n for n in by_class if n != own)]:
        others = [i for i in by_class[name] if i != target and corpus.offsets[i + 1] - corpus.offsets[i] >= QUERY_WORDS]
        if others and len(queries) < QUERIES:
            clip = others[int(sampled([corpus.clips[i].clip for i in others], 1)[0])]
            count = int(corpus.offsets[clip + 1] - corpus.offsets[clip])
            first = (count - QUERY_WORDS) // 2
            queries.append((f"{name}: {_query_name(material, clip, first)}", clip, first))
    return target, queries


def _labelled_queries(material: Material, view: View, target: int) -> list[tuple[str, int, int]]:
    """From the middle of labelled segments, of other clips where there are such, of classes the sequence holds."""
    corpus = material.corpus
    wanted = {s.label for s in material.segments[corpus.clips[target].clip]}
    found: dict[str, tuple[bool, float, int, int]] = {}
    for i in view.clips.tolist():
        known = corpus.clips[i]
        words = corpus.words_of(i)
        middles = (corpus.starts[words] + corpus.stops[words]) / 2 / known.fps
        for segment in material.segments.get(known.clip, ()):
            first = int(np.abs(middles - (segment.start + segment.stop) / 2).argmin()) - QUERY_WORDS // 2
            if segment.label in wanted and 0 <= first <= len(middles) - QUERY_WORDS:
                key = (i == target, -(segment.stop - segment.start), i, first)
                found[segment.label] = min(found.get(segment.label, key), key)
    ranked = sorted(found.items(), key=lambda f: (f[1], f[0]))[:QUERIES]
    return [(f"{label}: {_query_name(material, clip, first)}", clip, first) for label, (_, _, clip, first) in ranked]


def _query_name(material: Material, clip: int, first: int) -> str:
    corpus = material.corpus
    word = int(corpus.offsets[clip]) + first
    known = corpus.clips[clip]
    return "".join(
        source(material, Word(known.clip, int(corpus.starts[word]), int(corpus.stops[word + QUERY_WORDS - 1])))
    )

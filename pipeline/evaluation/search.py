"""How good the answers of whole-clip search are on a labelled lake: the default search, each method, and DTW."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.evaluation.clips import LEAVE_ONE_OUT, LabelledOptions, split_of
from motionlake.evaluation.dtw import frame_distances
from motionlake.evaluation.ranking import Questions, score_search
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.retrieval.fused import EVERY, FusedSearcher
from motionlake.retrieval.labelled_clips import SignedClip
from motionlake.retrieval.protocol import Query, Scope, Searcher
from motionlake.retrieval.registry import methods, ready, searcher
from motionlake.stages.moves import read_tracks
from motionlake.stages.reader import lake_reader

DEFAULT: Final = methods("clip")[0]
WITHOUT_GRAPH: Final = f"{DEFAULT} without graph"


def evaluate_search(
    con: Connection,
    lake: Lake,
    options: LabelledOptions,
    *,
    queries: str | None = None,
    repository: str | None = None,
) -> dict[str, Any]:
    """Every labelled clip is searched for among all others, or those of one split among those of another.

    Args:
        con, lake: the lake.
        options: which clips.
        queries, repository: values of the column split; the first alone: among "train".

    Returns:
        map, nn, top5, cross_subject_nn (None without subjects), n (queries) of the default search; protocol; methods:
        the same by name of every method that the lake is ready for, of the default without the graph, and of "dtw":
        whole-clip DTW of the joints that moves see, None where it was left out.

    Raises:
        UserError: no such column or split, nothing to measure, or the lake is not ready for search.
    """
    signed = options.signed(con).labelled()
    clips = signed.clips
    splits = {row["clip"]: row["split"] for row in fetch(con, "clips_with_parts")}
    if queries is None and repository is None:
        asked, known, protocol = list(clips), list(clips), LEAVE_ONE_OUT
    else:
        split = split_of([splits[clip.clip] for clip in clips], queries, repository)
        asked, known = ([clips[i] for i in rows] for rows in (split.queries, split.repository))
        protocol = f"{queries or 'test'} clips query {repository or 'train'} clips"
    questions = _questions(asked, known)
    options.notice(f"{protocol}: {len(asked)} queries, {len(known)} clips to find")
    scope = Scope(options.dataset, None if protocol == LEAVE_ONE_OUT else repository or "train", recorded_only=True,
                  min_quality=options.min_quality)  # fmt: skip

    def scored(distances: Float64Array) -> dict[str, Any]:
        subjects = [[clip.subject for clip in side] for side in (asked, known)]
        return asdict(score_search(distances, questions, *subjects))

    found: dict[str, Any] = {}
    for name in ready(lake, "clip"):
        found[name] = scored(_ranks(searcher("clip", name, lake), asked, known, scope))
        if name == DEFAULT:
            found[WITHOUT_GRAPH] = scored(_ranks(FusedSearcher(lake, graph=False), asked, known, scope))
    if not found:
        raise UserError(f"{lake.root}: is not ready for search; make it so with `motionlake run all`")
    apart = _dtw(lake, asked, known, options)
    found["dtw"] = None if apart is None else scored(apart)
    return {**found[DEFAULT], "protocol": protocol, "methods": found}


def _questions(asked: Sequence[SignedClip], known: Sequence[SignedClip]) -> Questions:
    labels = [[clip.label or "" for clip in side] for side in (asked, known)]
    others = [[a.clip != b.clip for b in known] for a in asked]
    same = np.array(others, dtype=np.bool_).reshape(len(asked), len(known))
    questions = Questions.of(labels[0], labels[1], same)
    if not len(questions.scored):
        raise UserError(
            f"none of {len(asked)} queries has a clip of its class among {len(known)}: there is nothing to measure; "
            "--label-column names another column of labels.csv"
        )
    return questions


def _ranks(found: Searcher, asked: Sequence[SignedClip], known: Sequence[SignedClip], scope: Scope) -> Float64Array:
    """[q, r] ranks of clips among the answers to each query; after the last where a clip is none."""
    places = {clip.clip: place for place, clip in enumerate(known)}
    ranks = np.full((len(asked), len(known)), float(EVERY))
    for row, clip in zip(ranks, asked, strict=True):
        try:
            (hits,) = found.search([Query(clip.clip)], EVERY, scope)
        except UserError:  # a clip that this method cannot compare finds nothing
            continue
        for hit in hits:
            if hit.clip in places:
                row[places[hit.clip]] = hit.rank
    return ranks


def _dtw(
    lake: Lake, asked: Sequence[SignedClip], known: Sequence[SignedClip], options: LabelledOptions
) -> Float64Array | None:
    with lake_reader(lake, served_config(lake)) as at:
        tracks = read_tracks(at, {clip.clip: clip.part for clip in [*asked, *known]})
    names = sorted(tracks)
    if {clip.clip for clip in [*asked, *known]} - set(names):
        return None
    found = frame_distances(
        [tracks[name].turned().joints.astype(np.float32) for name in names], options.dtw, options.notice
    )
    if found is None:
        return None
    rows, columns = ([names.index(clip.clip) for clip in side] for side in (asked, known))
    return np.asarray(found[np.ix_(rows, columns)])

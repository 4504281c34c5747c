"""How good the answers of whole-clip search are on a labelled lake: the default search, each method, and DTW."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, Final, cast

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.evaluation.clips import LEAVE_ONE_OUT, LabelledOptions, split_of
from motionlake.evaluation.dtw import frame_distances
from motionlake.evaluation.ranking import Questions, score_search
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.retrieval.fused import EVERY, FusedSearcher, compared_by
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.labelled_clips import SignedClip
from motionlake.retrieval.lake_shortlist import shortlist_of
from motionlake.retrieval.protocol import Finds, LakeSearcher, Query, Scope, Searcher
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

    by_name = _searchers(lake)
    if not by_name:
        raise UserError(f"{lake.root}: is not ready for search; make it so with `motionlake run all`")
    found: dict[str, Any] = {name: scored(ranks) for name, ranks in _ranks(by_name, asked, known, scope).items()}
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


class _Once(LakeSearcher):
    """A searcher that names all clips once for a query: several rankings of one query are made of them."""

    finds: Finds = "clip"

    def __init__(self, found: LakeSearcher) -> None:
        super().__init__(found.lake)
        self.name, self._found = found.name, found
        self._asked: tuple[Query, Scope, bool] | None = None
        self._answer: list[Hit] | UserError = []

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self._all(query, scope, mirrored)[:k] for query in queries]

    def _all(self, query: Query, scope: Scope, mirrored: bool) -> list[Hit]:
        asked = query, replace(scope, own=True), mirrored
        if asked != self._asked:
            self._asked = asked
            try:
                (self._answer,) = self._found.nearest([query], EVERY, asked[1], mirrored=mirrored)
            except UserError as error:
                self._answer = error
        if isinstance(self._answer, UserError):
            raise self._answer
        return [hit for hit in self._answer if scope.own or hit.clip != query.clip]

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        return self._found.distances(queries, gallery)


def _searchers(lake: Lake) -> dict[str, Searcher]:
    """What is measured, by name: the default with and without the graph, and each method."""
    names = ready(lake, "clip")
    if DEFAULT not in names:
        return {name: searcher("clip", name, lake) for name in names}
    large = bool(shortlist_of(lake, "range"))  # too large to compare all clips, and without a graph
    alone = {name: searcher("clip", name, lake, exact=not large) for name in names if name != DEFAULT}
    if large:
        default = FusedSearcher(lake)
        return {DEFAULT: default, WITHOUT_GRAPH: default, **alone}
    once = {name: _Once(cast(LakeSearcher, found)) for name, found in alone.items()}
    methods = {name: once[name] for name in compared_by(lake)}
    fused = {name: FusedSearcher(lake, searchers=methods, graph=graph)
             for name, graph in ((DEFAULT, True), (WITHOUT_GRAPH, False))}  # fmt: skip
    return {**fused, **once}


def _ranks(
    by_name: Mapping[str, Searcher], asked: Sequence[SignedClip], known: Sequence[SignedClip], scope: Scope
) -> dict[str, Float64Array]:
    """[q, r] ranks of clips among the answers to each query, by searcher; after the last where a clip is none."""
    places = {clip.clip: place for place, clip in enumerate(known)}
    ranks = {name: np.full((len(asked), len(known)), float(EVERY)) for name in by_name}
    for at, clip in enumerate(asked):
        for name, found in by_name.items():
            try:
                (hits,) = found.search([Query(clip.clip)], EVERY, scope)
            except UserError:  # a clip that this method cannot compare finds nothing
                continue
            for hit in hits:
                if hit.clip in places:
                    ranks[name][at, places[hit.clip]] = hit.rank
    return ranks


def _dtw(
    lake: Lake, asked: Sequence[SignedClip], known: Sequence[SignedClip], options: LabelledOptions
) -> Float64Array | None:
    with lake_reader(lake, served_config(lake)) as at:
        tracks = read_tracks(at.lake, {clip.clip: clip.part for clip in [*asked, *known]})
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

"""FloatArray of queries from a repository by what a lake holds beside descriptors, and the ranking fused of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, FloatArray
from motionlake.deep_motifs.emd import emd_many, emd_matrix
from motionlake.errors import UserError
from motionlake.evaluation.clips import PATIENCE, Chosen, Notice, worth_waiting
from motionlake.evaluation.ranking import ranked
from motionlake.lake.catalog import Connection
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake
from motionlake.motion.dtw import dtw_cross, dtw_matrix, frame_pairs
from motionlake.pesta.alignment.scan import pairwise
from motionlake.pesta.alignment.strings import Repository
from motionlake.retrieval.fused import FusedSearcher
from motionlake.retrieval.labelling.labelled_clips import DescribedClips, lake_ground
from motionlake.retrieval.protocol import EVERYTHING, Finds, Hit, Query, Scope
from motionlake.retrieval.symbol_strings import read_strings

# Transports a second on one core, from timings.
TRANSPORTS_PER_SECOND: Final = 8_000


def signature_distances(con: Connection, clips: DescribedClips, chosen: Chosen, notice: Notice) -> FloatArray | None:
    """[q, r] Earth Mover's FloatArray of signatures; None where a clip has none, or they would take minutes."""
    signatures = [signature for signature in clips.signatures if signature is not None]
    if not _all_have(len(signatures), clips, "signature", notice):
        return None
    pairs = len(chosen.queries) * len(chosen.repository) // (2 if chosen.left_out else 1)
    if pairs > PATIENCE * TRANSPORTS_PER_SECOND:
        notice(f"signatures are left out: {pairs} distances would take minutes; see `motionlake evaluate signatures`")
        return None
    known, ground = np.array(signatures, dtype=np.float32), lake_ground(con)
    if chosen.left_out:
        return emd_matrix(known, ground)
    return np.array([emd_many(known[query], known[chosen.repository], ground) for query in chosen.queries])


def alignment_distances(
    con: Connection, lake: Lake, clips: DescribedClips, chosen: Chosen, notice: Notice
) -> FloatArray | None:
    """[q, r] costs of alignment of whole strings as config.toml has it, the greater of both ways.

    None where a clip has no string.
    """
    try:
        strings = read_strings(con)
    except UserError:
        return None
    places = [strings.positions.get(clip.clip) for clip in clips.clips]
    known = [strings.repository.string(place) for place in places if place is not None]
    if not _all_have(len(known), clips, "string", notice):
        return None
    config = load_config(lake.config_file).alignment
    own, others = [known[i] for i in chosen.queries], [known[i] for i in chosen.repository]
    there = pairwise(own, Repository.of(others), strings.distances, config)
    back = pairwise(others, Repository.of(own), strings.distances, config)
    for costs, asked in ((there, own), (back, others)):
        costs /= np.array([len(string) for string in asked], dtype=np.float32)[:, None]
    return np.maximum(there, back.T)


def frame_distances(
    features: Sequence[Float32Array], chosen: Chosen, wanted: bool | None, notice: Notice
) -> FloatArray | None:
    """[q, r] whole-clip DTW of `features`, of every clip; None where it is not wanted or would take minutes."""
    if wanted is False:
        return None
    lengths = [len(each) for each in features]
    total = sum(lengths[i] for i in chosen.queries) * sum(lengths[i] for i in chosen.repository)
    if not worth_waiting(frame_pairs(lengths) if chosen.left_out else total, wanted, notice):
        return None
    if chosen.left_out:
        return dtw_matrix(features)
    return dtw_cross([features[i] for i in chosen.queries], [features[i] for i in chosen.repository])


def fused_distances(methods: Mapping[str, FloatArray], clips: DescribedClips, chosen: Chosen) -> FloatArray | None:
    """[q, r] what `FusedSearcher` makes of the whole rankings of methods, each [q, r]; None of a single one."""
    if len(methods) < 2:
        return None
    names = [clip.clip for clip in clips.clips]
    fused = FusedSearcher([_Computed(name, known, names, chosen) for name, known in methods.items()])
    place = {names[clip]: column for column, clip in enumerate(chosen.repository)}
    found = np.full((len(chosen.queries), len(chosen.repository)), np.inf)
    queries = [Query(names[query]) for query in chosen.queries]
    for row, hits in zip(found, fused.search(queries, len(chosen.repository)), strict=True):
        for hit in hits:
            row[place[hit.clip]] = hit.distance
    return found


class _Computed:
    """A `Searcher` whose distances are known."""

    finds: Finds = "clip"

    def __init__(self, name: str, distances: FloatArray, names: list[str], chosen: Chosen) -> None:
        self.name, self._distances, self._names, self._chosen = name, distances, names, chosen
        self._rows = {names[query]: row for row, query in enumerate(chosen.queries)}
        self._orders = ranked(distances, chosen.questions.candidates)

    def search(self, queries: Sequence[Query], k: int, scope: Scope = EVERYTHING) -> list[list[Hit]]:
        return [self._hits(self._rows[query.name], k) for query in queries]

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        raise NotImplementedError

    def _hits(self, row: int, k: int) -> list[Hit]:
        return [
            Hit(
                rank=rank,
                clip=self._names[self._chosen.repository[column]],
                distance=float(self._distances[row, column]),
                label=None,
                dataset="",
                seconds=0.0,
            )
            for rank, column in enumerate(self._orders[row][:k].tolist(), start=1)
        ]


def _all_have(count: int, clips: DescribedClips, what: str, notice: Notice) -> bool:
    missing = len(clips.clips) - count
    if missing and count:
        notice(f"{what}s are left out: {missing} of the clips have none; make them with `motionlake run all`")
    return not missing

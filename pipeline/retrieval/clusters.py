"""Groups of a lake's clips, without labels: by the distances of the default search, or by signatures alone.

By default a distance is the sum of two, each the mean over methods (those of the default search, by its weights):
how far clips are apart, over the median of all pairs, and how far they are along the neighbour graph of these clips.
The clusters are Ward's: of all pairs of clusters, those are joined that grow least by it. Without a number, that number
of clusters is taken whose silhouette along the graph is best.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
from motionlake.arrays import BoolArray, Float64Array, Int64Array
from motionlake.deep_motifs.classification import MOST, by_size, check_count, cluster_clips
from motionlake.deep_motifs.emd import emd_matrix
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.motion.diffusion import way_between
from motionlake.retrieval.labelled_clips import SignedClip, SignedClips, lake_ground, signed_clips
from motionlake.retrieval.protocol import EVERYTHING, ClipFilter, Query
from motionlake.retrieval.registry import ready
from motionlake.retrieval.weighing import WEIGHTS
from motionlake.stages.moves import read_tracks

ClusterMethod = Literal["fused", "signatures"]
CLUSTER_METHODS: Final[tuple[ClusterMethod, ...]] = get_args(ClusterMethod)


@dataclass(frozen=True)
class ClusteredClip:
    """The cluster of a clip, from 0, the largest first."""

    clip: str
    cluster: int
    label: str | None
    dataset: str


def clusters_of_lake(
    con: Connection, lake: Lake, k: int | None, scope: ClipFilter = EVERYTHING, method: str = "fused"
) -> tuple[list[ClusteredClip], float]:
    """The cluster of every clip with a signature, by cluster and name, and the mean silhouette.

    Args:
        con, lake: the lake.
        k: how many; None: the best number.
        scope: which clips.
        method: "fused", see the module, or "signatures" (`cluster_clips`, Deep Motifs, section 4.3).

    Raises:
        UserError: too few clips for so many clusters, no signatures, or no such method.
    """
    if method not in CLUSTER_METHODS:
        raise UserError(f"--method {method}: use one of {', '.join(CLUSTER_METHODS)}")
    check_served(lake, "signature", "alignment")
    signed = signed_clips(con, scope)
    check_count(len(signed.clips), k)
    if method == "signatures":
        found = cluster_clips(emd_matrix(signed.signatures, lake_ground(con)), k)
        clusters, silhouette = found.clusters, found.silhouette
    else:
        clusters, silhouette = group(*fused(pair_distances(con, lake, signed)), k)
    rows = [
        ClusteredClip(clip.clip, int(cluster), clip.label, clip.dataset)
        for clip, cluster in zip(signed.clips, clusters, strict=True)
    ]
    return sorted(rows, key=lambda r: (r.cluster, r.clip)), silhouette


def pair_distances(con: Connection, lake: Lake, signed: SignedClips) -> dict[str, Float64Array]:
    """[n, n] distances of all n clips by each method of the default search that can compare them.

    A pair that a method cannot compare is as far as the median of its others.
    """
    there = set(ready(lake, "clip"))
    found = {"signature": emd_matrix(signed.signatures, lake_ground(con))}
    if "alignment" in there and (strings := _by_alignment(lake, signed.clips)) is not None:
        found["alignment"] = strings
    if "moves" in there and (moves := _by_moves(con, lake, signed.clips)) is not None:
        found["moves"] = moves
    return found


def _by_alignment(lake: Lake, clips: list[SignedClip]) -> Float64Array | None:
    from motionlake.retrieval.alignment import AlignmentSearcher

    searcher = AlignmentSearcher(lake)
    strings = searcher.strings
    # A posture that is held is found anywhere.
    compared = [
        clip.clip in strings.positions and len(strings.string_of(strings.positions[clip.clip])) > 1 for clip in clips
    ]
    queries = [Query(clip.clip) for clip, known in zip(clips, compared, strict=True) if known]
    return _spread(searcher.distances(queries, queries), np.array(compared))


def _by_moves(con: Connection, lake: Lake, clips: list[SignedClip]) -> Float64Array | None:
    from motionlake.motion.dtw import dtw_matrix

    tracks = read_tracks(lake, {clip.clip: clip.part for clip in clips})
    compared = np.array([clip.clip in tracks for clip in clips])
    return _spread(dtw_matrix([tracks[c.clip].moves() for c in clips if c.clip in tracks]), compared)


def _spread(found: Float64Array, compared: BoolArray) -> Float64Array | None:
    """[n, n] of distances [m, m] of the compared of n clips; None where these are fewer than two."""
    rows = np.flatnonzero(compared)
    if len(rows) < 2:
        return None
    among = (found + found.T) / 2
    spread = np.full((len(compared), len(compared)), np.median(among[np.triu_indices(len(rows), 1)]))
    spread[np.ix_(rows, rows)] = among
    np.fill_diagonal(spread, 0)
    return spread


def fused(of_each: Mapping[str, Float64Array]) -> tuple[Float64Array, Float64Array]:
    """[n, n] how far clips are apart, and how far along the graph, from distances [n, n] by each method."""
    total = sum(WEIGHTS.get(name, 1.0) for name in of_each)
    apart = np.zeros(next(iter(of_each.values())).shape)
    way = apart.copy()
    for name, distances in of_each.items():
        share = WEIGHTS.get(name, 1.0) / total
        median = float(np.median(distances[np.triu_indices(len(distances), 1)]))
        apart += share * distances / (median if median > 0 else 1.0)
        way += share * (1 - way_between(distances))
    return apart, np.maximum(way, 0)


def group(apart: Float64Array, way: Float64Array, k: int | None) -> tuple[Int64Array, float]:
    """[n] cluster of each clip, the largest first, and their mean silhouette along the graph.

    Args:
        apart, way: [n, n], symmetric, zero on the diagonal (`fused`).
        k: how many clusters; None takes the number, from 2 up, with the best silhouette.

    Raises:
        UserError: k below 2, or not below the number of clips.
    """
    from scipy.cluster.hierarchy import fcluster, ward
    from scipy.spatial.distance import squareform

    check_count(len(apart), k)
    tree = ward(squareform(apart + way, checks=False))
    wanted = [k] if k is not None else range(2, min(MOST, len(apart) - 1) + 1)
    found = [np.asarray(fcluster(tree, count, "maxclust")) for count in wanted]
    rated = [(_silhouette(way, clusters), clusters) for clusters in found]
    best, clusters = max(rated, key=lambda each: each[0])
    return by_size(clusters), best


def _silhouette(distances: Float64Array, clusters: Int64Array) -> float:
    from sklearn.metrics import silhouette_score

    if not 1 < len(np.unique(clusters)) < len(clusters):
        return -1.0
    return float(silhouette_score(distances, clusters, metric="precomputed"))

"""Classes of a lake's whole clips, by labelled ones, and clusters without labels (Deep Motifs, 4.3 and 5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.classification import Method, classify_knn, classify_one_vs_all, cluster_clips
from motionlake.deep_motifs.emd import emd_many, emd_matrix
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.labelled_clips import lake_ground, signed_clips
from motionlake.retrieval.protocol import EVERYTHING, ClipFilter, Query
from motionlake.retrieval.signature import SignatureSearcher

RECORDED: Final = ClipFilter(recorded_only=True)


@dataclass(frozen=True)
class ClassifiedClip:
    """The class found for a clip; see `motionlake.deep_motifs.classification.Prediction`."""

    clip: str
    label: str
    confidence: float
    distance: float


class LakeClassifier:
    """Classifies clips by the labelled clips of a lake, which are read once."""

    def __init__(
        self, lake: Lake, *, method: Method = "knn", k: int = 5, scope: ClipFilter = RECORDED, column: str = "label"
    ) -> None:
        """Read the labelled clips.

        Args:
            lake: whose clips teach.
            method: "knn" or "one_vs_all".
            k: neighbours of "knn".
            scope: which clips teach; by default all that are recorded.
            column: what their label is.

        Raises:
            UserError: no labelled clips, no such column, or fewer than one neighbour.
        """
        if k < 1:
            raise UserError(f"k is {k}: at least 1 clip must vote")
        self._lake, self._method, self._k = lake, method, k
        with reading(lake) as con:
            self.ground = lake_ground(con)
            self.known = signed_clips(con, scope, column).labelled()
        if not self.known.clips:
            raise UserError(f"no clip has a {column} to learn from; labels.csv beside the clips gives them")

    def classify(self, queries: Sequence[Query]) -> list[ClassifiedClip]:
        """The classes of clips of the lake, of clip files and of ranges; a labelled clip does not teach itself.

        Raises:
            UserError: no such clip or file, or it has no signature yet.
        """
        searcher = SignatureSearcher(self._lake)
        return [self._verdict(query.name, searcher.signature(query)) for query in queries]

    def _verdict(self, name: str, signature: Float32Array) -> ClassifiedClip:
        others = np.array([i for i, clip in enumerate(self.known.clips) if clip.clip != name], dtype=np.int64)
        if not len(others):
            raise UserError(f"{name}: is the only labelled clip: there is nothing to learn from")
        labels = [self.known.labels[i] for i in others]
        distances = emd_many(signature, self.known.signatures[others], self.ground)[None]
        if self._method == "knn":
            (found,) = classify_knn(distances, labels, self._k)
        else:
            (found,) = classify_one_vs_all(distances, self._between[np.ix_(others, others)], labels)
        return ClassifiedClip(name, found.label, found.confidence, found.distance)

    @cached_property
    def _between(self) -> Float64Array:
        return emd_matrix(self.known.signatures, self.ground)


@dataclass(frozen=True)
class ClusteredClip:
    """The cluster of a clip, from 0, the largest first."""

    clip: str
    cluster: int
    label: str | None
    dataset: str


def clusters_of_lake(
    con: Connection, k: int | None, scope: ClipFilter = EVERYTHING
) -> tuple[list[ClusteredClip], float]:
    """The cluster of every clip with a signature, by cluster and name, and the mean silhouette; see `cluster_clips`.

    Raises:
        UserError: too few clips for so many clusters, or no signatures.
    """
    signed = signed_clips(con, scope)
    found = cluster_clips(emd_matrix(signed.signatures, lake_ground(con)), k)
    rows = [
        ClusteredClip(clip.clip, int(cluster), clip.label, clip.dataset)
        for clip, cluster in zip(signed.clips, found.clusters, strict=True)
    ]
    return sorted(rows, key=lambda r: (r.cluster, r.clip)), found.silhouette

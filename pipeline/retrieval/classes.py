"""Classes of a lake's whole clips, by labelled ones (Deep Motifs, section 5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.classification import Prediction, classify_knn, classify_one_vs_all
from motionlake.deep_motifs.emd import emd_many, emd_matrix
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.fused import EVERY, REACH, FusedSearcher
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.labelled_clips import lake_ground, signed_clips
from motionlake.retrieval.protocol import ClipFilter, Query, Scope
from motionlake.retrieval.signature import SignatureSearcher

Method = Literal["search", "knn", "one_vs_all"]
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
        self, lake: Lake, *, method: Method = "search", k: int = 5, scope: ClipFilter = RECORDED, column: str = "label"
    ) -> None:
        """Read the labelled clips.

        Args:
            lake: whose clips teach.
            method: "search": the labelled clips that the default search finds first vote; "knn": those nearest by
                signatures; "one_vs_all".
            k: clips that vote.
            scope: which clips teach; by default all that are recorded.
            column: what their label is.

        Raises:
            UserError: no labelled clips, no such column, or fewer than one neighbour.
        """
        if k < 1:
            raise UserError(f"k is {k}: at least 1 clip must vote")
        self._lake, self._method, self._k, self._scope = lake, method, k, scope
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
        if self._method == "search":
            search = FusedSearcher(self._lake)
            return [self._by_search(search, query) for query in queries]
        searcher = SignatureSearcher(self._lake)
        return [self._verdict(query.name, searcher.signature(query)) for query in queries]

    def _by_search(self, search: FusedSearcher, query: Query) -> ClassifiedClip:
        """A vote of the first k answers that are labelled; a tie goes to the class of the first of them."""
        scope = Scope(**vars(self._scope.clips))
        voters: list[Hit] = []
        for count in (REACH, EVERY):
            if len(voters) < self._k:
                (hits,) = search.nearest([query], count, scope, mirrored=False)
                voters = [hit for hit in hits if hit.clip in self._labels and hit.clip != query.name][: self._k]
        if not voters:
            raise _alone(query.name)
        distances = np.array([[hit.distance for hit in voters]])
        return _named(query.name, *classify_knn(distances, [self._labels[hit.clip] for hit in voters], self._k))

    @cached_property
    def _labels(self) -> dict[str, str]:
        return {clip.clip: clip.label or "" for clip in self.known.clips}

    def _verdict(self, name: str, signature: Float32Array) -> ClassifiedClip:
        others = np.array([i for i, clip in enumerate(self.known.clips) if clip.clip != name], dtype=np.int64)
        if not len(others):
            raise _alone(name)
        labels = [self.known.labels[i] for i in others]
        distances = emd_many(signature, self.known.signatures[others], self.ground)[None]
        if self._method == "knn":
            (found,) = classify_knn(distances, labels, self._k)
        else:
            (found,) = classify_one_vs_all(distances, self._between[np.ix_(others, others)], labels)
        return _named(name, found)

    @cached_property
    def _between(self) -> Float64Array:
        return emd_matrix(self.known.signatures, self.ground)


def _named(name: str, found: Prediction) -> ClassifiedClip:
    return ClassifiedClip(name, found.label, found.confidence, found.distance)


def _alone(name: str) -> UserError:
    return UserError(f"{name}: is the only labelled clip: there is nothing to learn from")

"""Classes of a lake's whole clips (Deep Motifs, sections 4.3 and 5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.classification import Method, classify_knn, classify_one_vs_all
from motionlake.deep_motifs.emd import emd_many, emd_matrix
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.retrieval.encode import serving_models, signature_of_motifs, words_of_file
from motionlake.retrieval.labelling.signed import lake_ground, signed_clips


@dataclass(frozen=True)
class ClassifiedClip:
    """The class found for a clip; see `motionlake.deep_motifs.classification.Verdict`."""

    clip: str
    label: str
    confidence: float
    distance: float

    def as_row(self) -> dict[str, object]:
        return asdict(self)


class LakeClassifier:
    """Classifies clips by the labelled clips of a lake."""

    def __init__(
        self,
        con: Connection,
        lake: Lake,
        *,
        method: Method = "knn",
        k: int = 5,
        dataset: str | None = None,
        column: str = "label",
    ) -> None:
        """Read the labelled clips.

        Args:
            con: to the lake.
            lake: for clip files.
            method: "knn" or "one_vs_all".
            k: neighbours of "knn".
            dataset: only clips of this dataset teach; by default all that are recorded.
            column: what their label is.

        Raises:
            UserError: no labelled clips, or no such column.
        """
        self._con, self._lake, self._method, self._k = con, lake, method, k
        self.ground = lake_ground(con)
        self.known = signed_clips(con, dataset, column, real=dataset is None).labelled()
        if not self.known.clips:
            raise UserError(f"no clip has a {column} to learn from; labels.csv beside the clips gives them")
        self._between: Float64Array | None = None

    def clips(self, names: Sequence[str]) -> list[ClassifiedClip]:
        """The classes of clips of the lake; a labelled one does not teach itself.

        Raises:
            UserError: a clip has no signature yet.
        """
        signed = signed_clips(self._con)
        rows = {clip.clip: i for i, clip in enumerate(signed.clips)}
        for name in names:
            if name not in rows:
                raise UserError(f"{name}: has no signature yet; make it with `motionlake run all`")
        return [self._verdict(name, signed.signatures[rows[name]]) for name in names]

    def file(self, path: Path) -> ClassifiedClip:
        """The class of a clip file (its first body), which need not be in the lake.

        Raises:
            UserError: the file cannot be read.
        """
        models = serving_models(self._con, self._lake)
        file = words_of_file(self._lake, models.config.words, path)
        signature = signature_of_motifs(self._con, models.motifs_of(file.features))
        return self._verdict(str(path), signature)

    def _verdict(self, name: str, signature: Float32Array) -> ClassifiedClip:
        others = np.array([i for i, clip in enumerate(self.known.clips) if clip.clip != name], dtype=np.int64)
        if not len(others):
            raise UserError(f"{name}: is the only labelled clip: there is nothing to learn from")
        labels = [self.known.labels[i] for i in others]
        distances = emd_many(signature, self.known.signatures[others], self.ground)[None]
        if self._method == "knn":
            found = classify_knn(distances, labels, self._k)[0]
        else:
            if self._between is None:
                self._between = emd_matrix(self.known.signatures, self.ground)
            found = classify_one_vs_all(distances, self._between[np.ix_(others, others)], labels)[0]
        return ClassifiedClip(name, found.label, found.confidence, found.distance)

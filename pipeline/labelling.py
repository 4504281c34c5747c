"""Labels for a lake's clips: along them (segmentation), as a whole (classification), and without any (clusters)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.applications.classification import Method, classify_knn, classify_one_vs_all
from pipeline.applications.clustering import cluster_clips
from pipeline.applications.segmentation import (
    Band,
    SegmentationConfig,
    Segmenter,
    TaughtRange,
    bands,
    taught_windows,
    word_centres,
)
from pipeline.corpus import Corpus, read_corpus
from pipeline.emd import emd_many, emd_matrix, ground_distances
from pipeline.errors import UserError
from pipeline.lake.catalog import Connection, fetch
from pipeline.lake.layout import Lake
from pipeline.signing import serving_models, signature_of_motifs, words_of_file
from pipeline.stages import words

Float64Array = NDArray[np.float64]
Signatures = NDArray[np.float32]


@dataclass(frozen=True)
class Lessons:
    """Where a segmentation learns its classes.

    Attributes:
        datasets: clips of these datasets teach; all clips where `clips` is None as well.
        clips: names of clips that teach.
        column: what a clip without segments teaches as a whole: "label", or another column of labels.csv.
        mirrored: clips teach their mirror images too.
    """

    datasets: Sequence[str] | None = None
    clips: Sequence[str] | None = None
    column: str = "label"
    mirrored: bool = True

    @property
    def all(self) -> bool:
        return self.datasets is None and self.clips is None


@dataclass(frozen=True)
class LabelledBand:
    """Frames [start, stop) of a clip, at its own rate, that show one class."""

    start: int
    stop: int
    label: str
    distance: float
    confidence: float
    start_seconds: float
    seconds: float

    def as_row(self) -> dict[str, object]:
        return asdict(self)


class LakeSegmenter:
    """Segments clips by what clips of a lake teach; `corpus` where its signed words have been read already."""

    def __init__(
        self,
        con: Connection,
        lake: Lake,
        lessons: Lessons | None = None,
        config: SegmentationConfig | None = None,
        corpus: Corpus | None = None,
    ) -> None:
        self._con, self._lake = con, lake
        self._lessons = lessons or Lessons()
        self._config = config or SegmentationConfig()
        self.corpus = corpus or read_corpus(con)
        check_column(con, self._lessons.column)
        self._ranges = taught_ranges(con, self.corpus, self._lessons)

    def clip(self, name: str) -> list[LabelledBand]:
        """The bands of a clip of the lake; it does not teach itself.

        Raises:
            UserError: the clip has no words yet, or there is nothing else to learn from.
        """
        index = self.corpus.positions.get(name)
        if index is None:
            raise UserError(f"{name}: has no signature yet; make it with `motionlake run all`")
        found = self.segmenter(index).label_words(self.corpus.motifs[self.corpus.words_of(index)], self.corpus.idf)
        clip = self.corpus.clips[index]
        return _timed(bands(found, word_centres(self.corpus, index), clip.frames), clip.fps)

    def file(self, path: Path) -> list[LabelledBand]:
        """The same for a clip file (its first body), which need not be in the lake.

        Raises:
            UserError: the file cannot be read, or there is nothing to learn from.
        """
        models = serving_models(self._con, self._lake)
        file = words_of_file(self._lake, models.config.words, path)
        found = self.segmenter(None).label_words(models.motifs_of(file.features), self.corpus.idf)
        centres = (file.ranges[:, 0] + file.ranges[:, 1] - 1) / 2
        return _timed(bands(found, centres, file.frames), file.fps)

    def segmenter(self, without: int | None) -> Segmenter:
        """What the clips teach, one of them left out.

        Raises:
            UserError: there is nothing to learn from.
        """
        ranges = [r for r in self._ranges if r.clip != without]
        mirrored = None
        if self._lessons.mirrored:
            mirrored = mirrored_motifs(self._con, self._lake, self.corpus, (r.clip for r in ranges))
        teaching = taught_windows(self.corpus, ranges, self._config.window, mirrored)
        return Segmenter(teaching, self.corpus.ground, self._config)


def mirrored_motifs(con: Connection, lake: Lake, corpus: Corpus, clips: Iterable[int]) -> dict[int, NDArray[np.int32]]:
    """Motifs of the words of some clips of a lake, by index, mirrored left to right."""
    models = serving_models(con, lake)
    wanted = {corpus.clips[clip].clip: clip for clip in clips}
    parts = {row["part"] for row in fetch(con, "queries/words_per_clip.sql") if row["clip"] in wanted}
    found = {}
    for part in words.keyed(con, models.config.words):
        if part.part in parts:
            for name, features in words.read_features(lake.path(words.features_file(part.key))):
                if name in wanted:
                    found[wanted[name]] = models.mirrored_motifs_of(features)
    return found


def taught_ranges(con: Connection, corpus: Corpus, lessons: Lessons) -> list[TaughtRange]:
    """Labelled frames: segments where a clip has them, else the whole clip where it has a label.

    Where no dataset and no clip is named, whole clips teach only if there are no segments in the lake.

    Raises:
        UserError: a named dataset or clip teaches nothing.
    """
    chosen = {
        "datasets": None if lessons.datasets is None else list(lessons.datasets),
        "clips": None if lessons.clips is None else list(lessons.clips),
    }
    rows = fetch(con, "queries/taught_segments.sql", chosen)
    if not lessons.all or not rows:
        whole = fetch(con, "queries/taught_clips.sql", {**chosen, "column": lessons.column})
        rows += [{"clip": r["clip"], "start": r["start"], "stop": r["stop"], "label": r["taught"]} for r in whole]
    taught = {r["clip"] for r in rows}
    datasets = {corpus.clips[corpus.positions[clip]].dataset for clip in taught}
    for dataset in lessons.datasets or ():
        if dataset not in datasets:
            raise UserError(f"{dataset}: no clip of this dataset has segments or a {lessons.column} to learn from")
    for clip in lessons.clips or ():
        if clip not in taught:
            raise UserError(f"{clip}: has neither segments nor a {lessons.column} to learn from")
    return [TaughtRange(corpus.positions[r["clip"]], r["start"], r["stop"], r["label"]) for r in rows]


def _timed(found: Sequence[Band], fps: float) -> list[LabelledBand]:
    return [LabelledBand(**asdict(b), start_seconds=b.start / fps, seconds=(b.stop - b.start) / fps) for b in found]


@dataclass(frozen=True)
class SignedClip:
    """One clip that has a signature; `part` holds its frames, at `fps`."""

    clip: str
    dataset: str
    path: str
    part: str
    fps: float
    subject: str | None
    label: str | None


@dataclass(frozen=True)
class SignedClips:
    """n clips, and their signatures [n, K]."""

    clips: list[SignedClip]
    signatures: Signatures

    def labelled(self) -> SignedClips:
        """Those with a label."""
        at = [i for i, clip in enumerate(self.clips) if clip.label is not None]
        return SignedClips([self.clips[i] for i in at], self.signatures[at])

    @property
    def labels(self) -> list[str]:
        """[n] labels; "" where there is none."""
        return [clip.label or "" for clip in self.clips]


def signed_clips(
    con: Connection, dataset: str | None = None, column: str = "label", only: tuple[str, str] | None = None
) -> SignedClips:
    """The lake's clips that have a signature, by name.

    Args:
        con: to the lake.
        dataset: of this dataset only.
        column: what becomes their label: "label", "subject", "split", "dataset" or a column of labels.csv.
        only: a column and the value it must have.

    Raises:
        UserError: no such column, or no signed clip.
    """
    check_column(con, column)
    if only is not None:
        check_column(con, only[0])
    parameters = {
        "dataset": dataset,
        "column": column,
        "only_column": only and only[0],
        "only_value": only and only[1],
    }
    rows = fetch(con, "queries/labelled_clips.sql", parameters)
    if not rows:
        where = f" of dataset {dataset}" if dataset else ""
        where += f" with {only[0]} = {only[1]}" if only else ""
        raise UserError(f"no clip{where} has a signature; `motionlake status` shows what there is")
    signatures = np.array([row.pop("signature") for row in rows], dtype=np.float32)
    return SignedClips([SignedClip(**row) for row in rows], signatures)


def check_column(con: Connection, column: str) -> None:
    """Raises `UserError` where no clip has such a column."""
    known = [r["name"] for r in fetch(con, "queries/label_columns.sql")]
    if column not in known:
        raise UserError(f"{column}: no such column of labels; there are {', '.join(known)}")


def lake_ground(con: Connection) -> Float64Array:
    """[K, K] distances of the lake's motifs. Raises `UserError` where it has none."""
    rows = fetch(con, "queries/corpus_motifs.sql")
    if not rows:
        raise UserError("the lake has no motifs yet; make them with `motionlake run all`")
    return ground_distances(np.array([r["centroid"] for r in rows], dtype=np.float32))


@dataclass(frozen=True)
class ClassifiedClip:
    """The class found for a clip; see `pipeline.applications.classification.Verdict`."""

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
            dataset: only clips of this dataset teach.
            column: what their label is.

        Raises:
            UserError: no labelled clips, or no such column.
        """
        self._con, self._lake, self._method, self._k = con, lake, method, k
        self.ground = lake_ground(con)
        self.known = signed_clips(con, dataset, column).labelled()
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

    def _verdict(self, name: str, signature: Signatures) -> ClassifiedClip:
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


@dataclass(frozen=True)
class ClusteredClip:
    """The cluster of a clip, from 0, the largest first."""

    clip: str
    cluster: int
    label: str | None
    dataset: str

    def as_row(self) -> dict[str, object]:
        return asdict(self)


def clusters_of_lake(con: Connection, k: int | None, dataset: str | None = None) -> tuple[list[ClusteredClip], float]:
    """Every signed clip's cluster, by cluster and name, and the mean silhouette; see `cluster_clips`.

    Raises:
        UserError: too few clips for so many clusters, or no signatures.
    """
    signed = signed_clips(con, dataset)
    found = cluster_clips(emd_matrix(signed.signatures, lake_ground(con)), k)
    rows = [
        ClusteredClip(clip.clip, int(cluster), clip.label, clip.dataset)
        for clip, cluster in zip(signed.clips, found.clusters, strict=True)
    ]
    return sorted(rows, key=lambda r: (r.cluster, r.clip)), found.silhouette

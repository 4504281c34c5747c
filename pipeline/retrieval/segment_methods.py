"""Two ways to tell the classes along a lake's clips from labelled ranges: words, and the signatures of windows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from typing import Any, Final, Literal, get_args

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int32Array
from motionlake.deep_motifs.segmentation import (
    LabelledRange,
    SegmentationConfig,
    Segmenter,
    WordLabels,
    labelled_windows,
    word_centres,
)
from motionlake.deep_motifs.signatures import Corpus
from motionlake.deep_motifs.word_segmentation import ClipWords, WordSegmentation, WordSegmenter, taught_words
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.motion.moves import Track
from motionlake.retrieval.encode import FileWords, Models, serving_models
from motionlake.stages import words
from motionlake.stages.moves import joints_of, read_tracks

Config = WordSegmentation | SegmentationConfig
MethodName = Literal["words", "signatures"]
METHODS: Final[tuple[MethodName, ...]] = get_args(MethodName)
# The class of each word of what a `SegmentMethod` sees of a clip; the flag: always a class, never "unknown".
Labeller = Callable[[Any, bool], WordLabels]


def config_of(method: str, window: int | None, k: int | None, reach: int | None, *, unknown: bool = True) -> Config:
    """The configuration that options of a command are of; None: the method's own.

    Raises:
        UserError: there is no such method, or it has no such option.
    """
    given = {name: value for name, value in (("window", window), ("k", k), ("reach", reach)) if value is not None}
    if method == "signatures":
        return SegmentationConfig(**given, unknown=1.0 if unknown else None)
    if method not in METHODS:
        raise UserError(f"--method {method}: use one of {', '.join(METHODS)}")
    if given:
        raise UserError(f"--{', --'.join(given)}: of the windows of --method signatures, which words do not have")
    return WordSegmentation(unknown=unknown)


class SegmentMethod(ABC):
    """One way to segment clips of a lake; `mirrored`: clips teach their mirror images too."""

    def __init__(self, con: Connection, lake: Lake, corpus: Corpus, *, mirrored: bool) -> None:
        self.corpus = corpus
        self._con, self._lake, self._mirrored = con, lake, mirrored

    @abstractmethod
    def read(self, clips: Iterable[int]) -> None:
        """Read clips, by their index, that teach or that are segmented. Raises `UserError` where one is not ready."""

    @abstractmethod
    def of_clip(self, clip: int) -> Any:
        """What is seen of the words of a clip that was read."""

    @abstractmethod
    def of_file(self, file: FileWords) -> Any:
        """What is seen of the words of a clip file."""

    @abstractmethod
    def taught(self, ranges: Sequence[LabelledRange]) -> Labeller:
        """What labelled ranges of clips that were read teach. Raises `UserError` where there are none."""

    @cached_property
    def _models(self) -> Models:
        return serving_models(self._con, self._lake)

    def _features(self, clips: Iterable[int]) -> Iterator[tuple[int, Float32Array]]:
        """Index and word features of clips, part by part."""
        wanted = {self.corpus.clips[clip].clip: clip for clip in clips}
        parts = {row["part"] for row in fetch(self._con, "words_per_clip") if row["clip"] in wanted}
        for part, file in words.features_files(self._con, self._models.config).items():
            if part in parts:
                for name, features in words.read_features(sound(self._lake, file)):
                    if name in wanted:
                        yield wanted[name], features


def segment_method(
    con: Connection, lake: Lake, corpus: Corpus, config: Config | None = None, *, mirrored: bool = True
) -> SegmentMethod:
    """The method that a configuration is of, by default that of words."""
    if isinstance(config, SegmentationConfig):
        return BySignatures(con, lake, corpus, config, mirrored=mirrored)
    return ByWords(con, lake, corpus, config or WordSegmentation(), mirrored=mirrored)


class ByWords(SegmentMethod):
    """By the nearest words of labelled segments (`deep_motifs.word_segmentation`)."""

    def __init__(
        self, con: Connection, lake: Lake, corpus: Corpus, config: WordSegmentation, *, mirrored: bool
    ) -> None:
        super().__init__(con, lake, corpus, mirrored=mirrored)
        self._config = config
        self._clips: dict[int, ClipWords] = {}

    def read(self, clips: Iterable[int]) -> None:
        missing = sorted({clip for clip in clips if clip not in self._clips})
        tracks = self._tracks(missing)
        for clip, features in self._features(missing):
            known = self.corpus.clips[clip]
            if clip not in tracks:
                raise UserError(f"{known.clip}: has no moves yet; make them with `motionlake run all`")
            pace = _pace(tracks[clip], word_centres(self.corpus, clip), known.frames)
            self._clips[clip] = self._words(features, pace, mirrored=self._mirrored)

    def of_clip(self, clip: int) -> ClipWords:
        return self._clips[clip]

    def of_file(self, file: FileWords) -> ClipWords:
        track = Track.of(joints_of(file.positions, file.fps))
        return self._words(file.features, _pace(track, file.centres, file.frames), mirrored=False)

    def taught(self, ranges: Sequence[LabelledRange]) -> Labeller:
        seen = [(each, self._clips[each.clip], word_centres(self.corpus, each.clip)) for each in ranges]
        segmenter = WordSegmenter(taught_words(seen), self._config)
        return lambda clip, forced: segmenter.label_words(clip, forced=forced)

    def _words(self, features: Float32Array, pace: Float64Array, *, mirrored: bool) -> ClipWords:
        turned = self._models.vectors_of(features, mirrored=True) if mirrored else None
        return ClipWords(self._models.vectors_of(features), turned, pace)

    def _tracks(self, clips: Sequence[int]) -> dict[int, Track]:
        if not clips:
            return {}
        wanted = {self.corpus.clips[clip].clip: clip for clip in clips}
        parts = {row["clip"]: row["part"] for row in fetch(self._con, "clips_with_parts") if row["clip"] in wanted}
        found = read_tracks(self._lake, parts)
        return {wanted[name]: track for name, track in found.items()}


def _pace(track: Track, centres: Float64Array, frames: int) -> Float64Array:
    """[w] how fast a body moves at the frames at the centres of words ([w]), of a clip of so many."""
    pace = track.pace()
    return np.asarray(np.interp(centres * (len(pace) - 1) / max(1, frames - 1), np.arange(len(pace)), pace))


class BySignatures(SegmentMethod):
    """By the signatures of the windows around words (`deep_motifs.segmentation`), the paper's."""

    def __init__(
        self, con: Connection, lake: Lake, corpus: Corpus, config: SegmentationConfig, *, mirrored: bool
    ) -> None:
        super().__init__(con, lake, corpus, mirrored=mirrored)
        self._config = config
        self._turned: dict[int, Int32Array] = {}

    def read(self, clips: Iterable[int]) -> None:
        if self._mirrored:
            for clip, features in self._features({clip for clip in clips if clip not in self._turned}):
                self._turned[clip] = self._models.motifs_of(features, mirrored=True)

    def of_clip(self, clip: int) -> Int32Array:
        return self.corpus.motifs[self.corpus.words_of(clip)]

    def of_file(self, file: FileWords) -> Int32Array:
        return self._models.motifs_of(file.features)

    def taught(self, ranges: Sequence[LabelledRange]) -> Labeller:
        turned = self._turned if self._mirrored else None
        teaching = labelled_windows(self.corpus, ranges, self._config.window, turned)
        segmenter = Segmenter(teaching, self.corpus.ground, self._config)
        return lambda motifs, forced: segmenter.label_words(motifs, self.corpus.idf, forced=forced)

"""Query by example on a lake: a range of one of its clips, or of a clip file, looked for inside every clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from motionlake.deep_motifs.corpus import Corpus
from motionlake.deep_motifs.query_by_example import ExampleQuery, RangeHit, find_ranges, words_within
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.corpus import read_corpus
from motionlake.lake.frames import frame_range
from motionlake.lake.layout import Lake
from motionlake.retrieval.encode import features_of_clip, serving_models, words_of_file


@dataclass(frozen=True)
class Found:
    """One answer: frames [start, stop) of a clip at its own rate, and its distance from the query.

    Attributes:
        mirrored: the mirrored query is nearer than the query itself.
        start_seconds: when it starts.
        seconds: how long it lasts.
    """

    rank: int
    clip: str
    start: int
    stop: int
    distance: float
    mirrored: bool
    label: str | None
    dataset: str
    start_seconds: float
    seconds: float

    def as_row(self) -> dict[str, object]:
        return asdict(self)


class Finder:
    """Queries to a lake; `corpus` where its signed words have been read already.

    With `real`, synthetic clips are no answers.
    """

    def __init__(self, con: Connection, lake: Lake, corpus: Corpus | None = None, *, real: bool = False) -> None:
        self._con, self._lake, self._real = con, lake, real
        self.corpus = corpus or read_corpus(con)

    def in_clip(
        self,
        clip: str,
        start: int | None,
        stop: int | None,
        k: int,
        *,
        dataset: str | None = None,
        mirrored: bool = False,
        own: bool = False,
    ) -> list[Found]:
        """The k ranges nearest to frames [start, stop) of a clip of the lake; ranges that overlap these are left out.

        `own`: they are not.

        Raises:
            UserError: the clip has no words yet, there are no such frames, or they hold fewer than two words.
        """
        corpus = self.corpus
        if clip not in corpus.positions:
            raise UserError(f"{clip}: has no signature yet; make it with `motionlake run all`")
        index = corpus.positions[clip]
        first, last = frame_range(clip, start, stop, corpus.clips[index].frames)
        words = corpus.words_of(index)
        chosen = words_within(corpus.starts[words], corpus.stops[words], first, last)
        turned = None
        if mirrored:
            models = serving_models(self._con, self._lake)
            features = features_of_clip(self._con, self._lake, models.config.words, clip)
            turned = models.mirrored_motifs_of(features)[chosen]
        query = _query(clip, corpus.motifs[words][chosen], turned)
        without = None if own else (index, first, last)
        hits = find_ranges(corpus, query, k, clips=self._clips(dataset), without=without)
        return _found(corpus, hits)

    def in_file(
        self,
        path: Path,
        start: int | None,
        stop: int | None,
        k: int,
        *,
        dataset: str | None = None,
        mirrored: bool = False,
    ) -> list[Found]:
        """The same for frames of a clip file (its first body), which need not be in the lake.

        Raises:
            UserError: the file cannot be read, there are no such frames, or they hold fewer than two words.
        """
        models = serving_models(self._con, self._lake)
        file = words_of_file(self._lake, models.config.words, path)
        first, last = frame_range(str(path), start, stop, file.frames)
        chosen = words_within(file.ranges[:, 0], file.ranges[:, 1], first, last)
        turned = models.mirrored_motifs_of(file.features)[chosen] if mirrored else None
        query = _query(str(path), models.motifs_of(file.features)[chosen], turned)
        return _found(self.corpus, find_ranges(self.corpus, query, k, clips=self._clips(dataset)))

    def _clips(self, dataset: str | None) -> list[int] | None:
        if dataset is None and not self._real:
            return None
        clips = enumerate(self.corpus.clips)
        return [i for i, c in clips if dataset in (None, c.dataset) and not (self._real and c.synthetic)]


def _query(name: str, motifs: np.ndarray, mirrored: np.ndarray | None) -> ExampleQuery:
    try:
        return ExampleQuery(motifs, mirrored)
    except UserError as error:
        raise UserError(f"{name}: {error}") from error


def _found(corpus: Corpus, hits: Sequence[RangeHit]) -> list[Found]:
    found = []
    for hit in hits:
        clip = corpus.clips[corpus.positions[hit.clip]]
        seconds = (hit.stop - hit.start) / clip.fps
        found.append(
            Found(
                **asdict(hit),
                label=clip.label,
                dataset=clip.dataset,
                start_seconds=hit.start / clip.fps,
                seconds=seconds,
            )
        )
    return found

"""Classes along a lake's clips (Deep Motifs, section 6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from motionlake.deep_motifs.segmentation import LabelledRange, SegmentRange, bands, word_centres
from motionlake.deep_motifs.signatures import Corpus
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, reading
from motionlake.lake.corpus import read_corpus
from motionlake.lake.layout import Lake
from motionlake.lake.models import check_served
from motionlake.lake.verdicts import good_rows
from motionlake.retrieval.encode import serving_models, words_of_file
from motionlake.retrieval.labelled_clips import check_column
from motionlake.retrieval.protocol import Query, not_ready
from motionlake.retrieval.segment_methods import Config, segment_method


@dataclass(frozen=True)
class Lessons:
    """Where a segmentation learns its classes.

    Attributes:
        datasets: clips of these datasets teach; all clips where `clips` is None as well.
        clips: names of clips that teach.
        column: what a clip without segments teaches as a whole: "label", or another column of labels.csv.
        mirrored: clips teach their mirror images too.
        min_quality: the worst verdict of stage "quality" that a clip that teaches may have; None: any.
    """

    datasets: list[str] | None = None
    clips: list[str] | None = None
    column: str = "label"
    mirrored: bool = True
    min_quality: str | None = None


@dataclass(frozen=True)
class LabelledBand(SegmentRange):
    """A range with its times."""

    start_seconds: float
    seconds: float


def corpus_of(lake: Lake) -> Corpus:
    """The encoded words of a lake, which may serve several segmenters."""
    with reading(lake) as con:
        return read_corpus(con)


class LakeSegmenter:
    """Segments clips by what clips of a lake teach; `corpus` where its signed words have been read already."""

    def __init__(
        self,
        lake: Lake,
        lessons: Lessons | None = None,
        config: Config | None = None,
        corpus: Corpus | None = None,
    ) -> None:
        self._lake, self._lessons, self._config = lake, lessons or Lessons(), config
        with reading(lake) as con:
            check_served(lake, "signature")
            self.corpus = corpus or read_corpus(con)
            check_column(con, self._lessons.column)
            self._ranges = taught_ranges(con, self.corpus, self._lessons)

    def segment(self, query: Query) -> list[LabelledBand]:
        """The bands of a clip of the lake, which does not teach itself, or of a clip file (its first body).

        Raises:
            UserError: no such clip or file, no words yet, or there is nothing to learn from.
        """
        with reading(self._lake) as con:
            method = segment_method(con, self._lake, self.corpus, self._config, mirrored=self._lessons.mirrored)
            if query.clip is None:
                file = words_of_file(self._lake, serving_models(con, self._lake).config, Path(query.source))
                seen, centres, frames, fps = method.of_file(file), file.centres, file.frames, file.fps
            else:
                index = self.corpus.positions.get(query.clip)
                if index is None:
                    raise not_ready(self._lake, query.clip, "signature")
                method.read([index])
                clip = self.corpus.clips[index]
                seen, centres, frames, fps = (
                    method.of_clip(index), word_centres(self.corpus, index), clip.frames, clip.fps,
                )  # fmt: skip
            ranges = [r for r in self._ranges if self.corpus.clips[r.clip].clip != query.clip]
            method.read(r.clip for r in ranges)
            found = method.taught(ranges)(seen, False)
        return _timed(bands(found, centres, frames), fps)


def taught_ranges(con: Connection, corpus: Corpus, lessons: Lessons) -> list[LabelledRange]:
    """Labelled frames: segments where a clip has them, else the whole clip where it has a label.

    Where no dataset and no clip is named, whole clips teach only if there are no segments in the lake.

    Raises:
        UserError: a named dataset or clip teaches nothing, or as `good_rows`.
    """
    chosen = {"datasets": lessons.datasets, "clips": lessons.clips}
    rows = fetch(con, "taught_segments", chosen)
    if chosen != {"datasets": None, "clips": None} or not rows:
        whole = fetch(con, "taught_clips", {**chosen, "column": lessons.column})
        rows += [{"clip": r["clip"], "start": r["start"], "stop": r["stop"], "label": r["taught"]} for r in whole]
    rows = good_rows(con, rows, lessons.min_quality, "ranges to learn from")
    taught = {r["clip"] for r in rows}
    datasets = {corpus.clips[corpus.positions[clip]].dataset for clip in taught}
    for dataset in lessons.datasets or ():
        if dataset not in datasets:
            raise UserError(f"{dataset}: no clip of this dataset has segments or a {lessons.column} to learn from")
    for clip in lessons.clips or ():
        if clip not in taught:
            raise UserError(f"{clip}: has neither segments nor a {lessons.column} to learn from")
    return [LabelledRange(corpus.positions[r["clip"]], r["start"], r["stop"], r["label"]) for r in rows]


def _timed(found: Sequence[SegmentRange], fps: float) -> list[LabelledBand]:
    return [LabelledBand(**asdict(b), start_seconds=b.start / fps, seconds=(b.stop - b.start) / fps) for b in found]

"""The labelled clips that an evaluation is made of: which query which, and their frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.errors import UserError
from motionlake.evaluation.ranking import Questions, others
from motionlake.lake import frames
from motionlake.lake.catalog import Connection
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model
from motionlake.retrieval.labelled_clips import (
    CodedClips,
    DescribedClip,
    FramedClip,
    SignedClips,
    coded_clips,
    signed_clips,
)
from motionlake.retrieval.protocol import ClipFilter

LEAVE_ONE_OUT: Final = "leave one out"
Notice = Callable[[str], None]


@dataclass(frozen=True)
class LabelledOptions:
    """Which labelled clips are measured, and by what.

    Attributes:
        dataset: its clips only.
        column: what says their class.
        only: a column and the value that a clip must have in it.
        dtw: compute the baseline, whole-clip DTW; None: where it takes at most `PATIENCE` seconds.
        notice: hears what takes long or is left out.
        min_quality: the worst verdict of stage "quality" that a clip may have; None: any.
    """

    dataset: str | None = None
    column: str = "label"
    only: tuple[str, str] | None = None
    dtw: bool | None = None
    notice: Notice = lambda line: None
    min_quality: str | None = None

    def signed(self, con: Connection) -> SignedClips:
        """The recorded clips that have a signature. Raises `UserError` where there is no such column."""
        return signed_clips(con, self._recorded, self.column, self.only)

    def coded(self, con: Connection) -> CodedClips:
        """The recorded clips that have a symbol string. Raises `UserError` where there is no such column."""
        return coded_clips(con, self._recorded, self.column, self.only)

    @property
    def _recorded(self) -> ClipFilter:
        return ClipFilter(self.dataset, recorded_only=True, min_quality=self.min_quality)


@dataclass(frozen=True)
class Split:
    """Which of n clips query which.

    Attributes:
        queries: [q] indices of clips.
        repository: [r] likewise.
        names: of both in the column split; None where each clip queries all others.
    """

    queries: Int64Array
    repository: Int64Array
    names: tuple[str, str] | None


def split_of(splits: Sequence[str | None], queries: str | None, repository: str | None) -> Split:
    """The clips of two splits, "test" and "train" by default; every clip where no name is given and these have none.

    Args:
        splits: [n] of each clip.
        queries, repository: names of splits.

    Raises:
        UserError: a split without a labelled clip.
    """
    names = queries or "test", repository or "train"
    rows = [np.flatnonzero([split == name for split in splits]) for name in names]
    if queries is None and repository is None and not all(map(len, rows)):
        return Split(np.arange(len(splits)), np.arange(len(splits)), None)
    for name, found in zip(names, rows, strict=True):
        if not len(found):
            known = sorted({split for split in splits if split})
            raise UserError(f"no labelled clip has split {name}; there are {', '.join(known) or 'no splits'}")
    return Split(rows[0], rows[1], names)


@dataclass(frozen=True)
class Chosen(Split):
    """A split, what its queries may find and what is relevant, and the protocol in words."""

    questions: Questions
    protocol: str


def choose(clips: list[DescribedClip], queries: str | None, repository: str | None) -> Chosen:
    """Queries and repository as `split_of` has them.

    Raises:
        UserError: as `split_of`; no query whose class the repository holds.
    """
    split = split_of([clip.split for clip in clips], queries, repository)
    asked, known = ([clips[i].label for i in rows] for rows in (split.queries, split.repository))
    candidates = others(len(asked)) if np.array_equal(split.queries, split.repository) else None
    questions = Questions.of(asked, known, candidates)
    protocol = "{} clips query {} clips".format(*split.names) if split.names else LEAVE_ONE_OUT
    if not len(questions.scored):
        raise UserError(
            f"{protocol}: none of {len(asked)} queries has a clip of its class among {len(known)}: there is nothing to "
            "measure; --label-column names another column of labels.csv"
        )
    return Chosen(split.queries, split.repository, split.names, questions, protocol)


def told(model: Model) -> dict[str, Any]:
    """The name of a model and what is known of its training."""
    return {"model": model.model, **{name: value for name, value in model.metrics.items() if name != "loss"}}


def read_frames(lake: Lake, clips: Sequence[FramedClip]) -> Iterator[frames.Frames]:
    """The canonical frames of clips; each frames part is read once."""
    names = {clip.clip for clip in clips}
    for dataset, part in sorted({(clip.dataset, clip.part) for clip in clips}):
        yield from frames.read_part(sound(lake, lake.frames_part(dataset, part)), names)


def read_positions(lake: Lake, clips: Sequence[FramedClip]) -> Iterator[tuple[str, float, Float64Array]]:
    """Name, rate and canonical joint positions [F, 21, 3] (metres) of clips without calibration poses; each frames part
    is read once."""
    for clip in read_frames(lake, clips):
        yield clip.clip, clip.fps, clip.recorded().positions.astype(np.float64)

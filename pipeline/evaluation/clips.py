"""What every evaluation on a lake shares: frames of its clips as whole-clip DTW compares them, and the DTW baseline."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.errors import UserError
from motionlake.evaluation.measures.dtw import baseline_features
from motionlake.evaluation.measures.ranking import others
from motionlake.evaluation.measures.split_retrieval import Questions
from motionlake.lake import frames
from motionlake.lake.layout import Lake
from motionlake.motion.dtw import CELLS_PER_SECOND, dtw_matrix, frame_pairs
from motionlake.retrieval.labelling.described import DescribedClip

Notice = Callable[[str], None]

# Whole-clip DTW is left out by default where it would take longer.
PATIENCE: Final = 300.0


class FramedClip(Protocol):
    """A clip of a lake; `part` holds its frames."""

    @property
    def clip(self) -> str: ...
    @property
    def dataset(self) -> str: ...
    @property
    def part(self) -> str: ...


def clip_features(lake: Lake, clips: Sequence[FramedClip]) -> list[Float32Array]:
    """What DTW compares, of every clip (`baseline_features`)."""
    found = {name: baseline_features(positions, fps) for name, fps, positions in read_positions(lake, clips)}
    return [found[clip.clip] for clip in clips]


def read_positions(lake: Lake, clips: Sequence[FramedClip]) -> Iterator[tuple[str, float, Float64Array]]:
    """Name, rate and canonical joint positions [F, 21, 3] (metres) of clips; each frames part is read once."""
    names = {clip.clip for clip in clips}
    for dataset, part in sorted({(clip.dataset, clip.part) for clip in clips}):
        for clip in frames.read_part(lake.path(lake.frames_part(dataset, part)), names):
            yield clip.clip, clip.fps, clip.positions.astype(np.float64)


def dtw_distances(lake: Lake, clips: Sequence[FramedClip]) -> Float64Array:
    """[n, n] whole-clip DTW between clips of a lake."""
    return dtw_matrix(clip_features(lake, clips))


def dtw_baseline(lake: Lake, clips: Sequence[FramedClip], wanted: bool | None, notice: Notice) -> Float64Array | None:
    """[n, n] the same; None where it is not wanted, or takes longer than `PATIENCE` seconds and is not asked for."""
    if wanted is False:
        return None
    features = clip_features(lake, clips)
    return dtw_matrix(features) if worth_waiting(frame_pairs([len(f) for f in features]), wanted, notice) else None


def worth_waiting(pairs: int, wanted: bool | None, notice: Notice) -> bool:
    """Whether so many frame distances are computed: where asked for, or in at most `PATIENCE` seconds."""
    seconds = pairs / CELLS_PER_SECOND
    if wanted is None and seconds > PATIENCE:
        notice(
            f"whole-clip DTW is left out: it would take about {seconds / 60:.0f} minutes; --baseline dtw computes it"
        )
        return False
    notice(f"whole-clip DTW: about {seconds:.0f} s")
    return True


QUERIES: Final = "test"
REPOSITORY: Final = "train"
LEAVE_ONE_OUT: Final = "leave one out"


@dataclass(frozen=True)
class Chosen:
    """q of n clips query r of them.

    Attributes:
        queries: [q] indices of clips.
        repository: [r] likewise.
        questions: what is relevant, and what a query may find.
        protocol: in words.
    """

    queries: Int64Array
    repository: Int64Array
    questions: Questions
    protocol: str

    @property
    def left_out(self) -> bool:
        """Whether each clip queries all others."""
        return self.protocol == LEAVE_ONE_OUT


def choose(clips: list[DescribedClip], queries: str | None, repository: str | None) -> Chosen:
    """Queries and repository by the column split; leave one out where nothing is asked for and there are no such.

    Raises:
        UserError: a split that is asked for and has no clip, or no query whose class the repository holds.
    """
    splits = np.array([clip.split or "" for clip in clips])
    asked, found = (np.flatnonzero(splits == name) for name in (queries or QUERIES, repository or REPOSITORY))
    if queries is None and repository is None and not (len(asked) and len(found)):
        asked = found = np.arange(len(clips))
        chosen = _chosen(clips, asked, found, LEAVE_ONE_OUT, apart=True)
    else:
        for name, rows in ((queries or QUERIES, asked), (repository or REPOSITORY, found)):
            if not len(rows):
                known = sorted(set(splits.tolist()) - {""})
                raise UserError(f"no labelled clip has split {name}; there are {', '.join(known) or 'no splits'}")
        protocol = f"{queries or QUERIES} clips query {repository or REPOSITORY} clips"
        chosen = _chosen(clips, asked, found, protocol, apart=np.array_equal(asked, found))
    if not len(chosen.questions.scored):
        raise UserError(
            f"{chosen.protocol}: none of {len(asked)} queries has a clip of its class among {len(found)}: there is "
            "nothing to measure; --label-column names another column of labels.csv"
        )
    return chosen


def _chosen(clips: list[DescribedClip], asked: Int64Array, found: Int64Array, protocol: str, *, apart: bool) -> Chosen:
    labels = [clip.label for clip in clips]
    candidates = others(len(asked)) if apart else None
    questions = Questions.of([labels[i] for i in asked], [labels[i] for i in found], candidates)
    return Chosen(asked, found, questions, protocol)

"""What every evaluation on a lake shares: queries and repository, their scores, frames of clips, the DTW baseline."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array, FloatArray, Int64Array
from motionlake.errors import UserError
from motionlake.evaluation.dtw import baseline_features
from motionlake.evaluation.ranking import (
    average_precision,
    others,
    precision_recall,
    ranked,
    ranked_relevance,
    share_label,
)
from motionlake.lake import frames
from motionlake.lake.layout import Lake
from motionlake.motion.dtw import CELLS_PER_SECOND, dtw_matrix, frame_pairs
from motionlake.retrieval.labelling.labelled_clips import DescribedClip

TOP: Final = 10


@dataclass(frozen=True)
class SplitScores:
    """Means over n queries, each from 0 to 1.

    Attributes:
        top1: the first hit is of the query's class.
        top10: share of the first ten hits (of all, where there are fewer) that are of the query's class.
        map: mean average precision.
        n: queries whose class the repository holds.
        pr_area: area under `curve`.
        curve: recall and precision, as `precision_recall` has them.
    """

    top1: float
    top10: float
    map: float
    n: int
    pr_area: float
    curve: dict[str, list[float]]

    def as_dict(self) -> dict[str, Any]:
        return {
            "top1": self.top1,
            "top10": self.top10,
            "map": self.map,
            "n": self.n,
            "pr_area": self.pr_area,
            "curve": self.curve,
        }


@dataclass(frozen=True)
class Questions:
    """q queries to a repository of r clips.

    Attributes:
        relevant: [q, r] the clip has the query's class.
        candidates: [q, r] what a query may find.
    """

    relevant: BoolArray
    candidates: BoolArray

    @classmethod
    def of(cls, queries: Sequence[str], repository: Sequence[str], candidates: BoolArray | None = None) -> Questions:
        """From the classes of queries [q] and repository [r]; `candidates`: all but where told."""
        relevant = share_label(queries, [(label,) for label in repository])
        may = np.ones_like(relevant) if candidates is None else candidates
        if may.shape != relevant.shape:
            raise ValueError(f"candidates of shape {may.shape} do not fit {relevant.shape} queries and clips")
        return cls(relevant & may, may)

    @property
    def scored(self) -> Int64Array:
        """The queries whose class the repository holds."""
        return np.flatnonzero(self.relevant.any(axis=1))


def score_split(distances: FloatArray, questions: Questions) -> SplitScores:
    """Score the distances [q, r] of queries from a repository.

    Raises:
        ValueError: shapes that do not fit, or no query whose class the repository holds.
    """
    rankings = ranked_relevance(distances, questions.relevant, questions.candidates)
    asked = [rankings[query] for query in questions.scored]
    if not asked:
        raise ValueError("no query has a clip of its class in the repository: nothing to retrieve")
    curve = precision_recall(asked)
    return SplitScores(
        float(np.mean([hits[0] for hits in asked])),
        float(np.mean([hits[:TOP].mean() for hits in asked])),
        float(np.mean([average_precision(hits) for hits in asked])),
        len(asked),
        area(curve),
        curve,
    )


def area(curve: dict[str, list[float]]) -> float:
    """Area under a precision-recall curve by trapezia; below its first recall it is level."""
    recall, precision = curve["recall"], curve["precision"]
    return float(np.trapezoid([precision[0], *precision], [0.0, *recall]))


def first_hits(distances: FloatArray, questions: Questions) -> dict[int, int]:
    """The nearest clip of each query whose class the repository holds: {query: clip}."""
    orders = ranked(distances, questions.candidates)
    return {int(query): int(orders[query][0]) for query in questions.scored}


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

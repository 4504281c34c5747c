"""Which clips of a lake query which: those of one split those of another, or each all others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from motionlake.errors import UserError
from motionlake.evaluation.measures.ranking import IntArray, others
from motionlake.evaluation.measures.split_retrieval import Questions
from motionlake.retrieval.labelling.described import DescribedClip

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

    queries: IntArray
    repository: IntArray
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


def _chosen(clips: list[DescribedClip], asked: IntArray, found: IntArray, protocol: str, *, apart: bool) -> Chosen:
    labels = [clip.label for clip in clips]
    candidates = others(len(asked)) if apart else None
    questions = Questions.of([labels[i] for i in asked], [labels[i] for i in found], candidates)
    return Chosen(asked, found, questions, protocol)

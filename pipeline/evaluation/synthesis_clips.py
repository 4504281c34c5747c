"""The real clips that synthesis is measured by: of the generator's classes, test clips and training clips."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.evaluation.clips import LEAVE_ONE_OUT, QUERIES, REPOSITORY, read_positions
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.retrieval.labelling.labelled_clips import check_column

# Of more than these, clips are taken at even distances of their names.
MOST_TEST: Final = 1000
MOST_TRAINING: Final = 2000


@dataclass(frozen=True)
class RealMotion:
    """A real clip, or a range of one.

    Attributes:
        clip: its name.
        dataset: it belongs to.
        label: its class.
        positions: [F, 21, 3] canonical joints, metres, y up.
        fps: frames a second.
        rest_offsets: [21, 3] of its body, metres.
    """

    clip: str
    dataset: str
    label: str
    positions: Float64Array
    fps: float
    rest_offsets: Float64Array

    def pieces(self, seconds: float) -> Iterator[RealMotion]:
        """One after the other, `seconds` long each; a rest that is shorter goes with the piece before it."""
        frames = max(2, round(seconds * self.fps))
        count = max(1, len(self.positions) // frames)
        for i in range(count):
            stop = len(self.positions) if i == count - 1 else (i + 1) * frames
            yield replace(self, positions=self.positions[i * frames : stop])


@dataclass(frozen=True)
class RealClips:
    """What a generator is measured by.

    Attributes:
        test: clips to go on from, and to compare with.
        training: clips that classes are learned from, and that might be copied.
        protocol: in words.
        split: of the test clips; None where there are no splits.
        strangers: how many labelled clips of the test split are of no class of the generator.
    """

    test: list[RealMotion]
    training: list[RealMotion]
    protocol: str
    split: str | None
    strangers: int


@dataclass(frozen=True)
class _Row:
    """Labelled frames [start, stop) of a clip of the lake; `part` holds them, at `fps`."""

    clip: str
    dataset: str
    part: str
    fps: float
    split: str | None
    rest_offsets: tuple[float, ...]
    start: int
    stop: int
    label: str


def real_clips(
    con: Connection, lake: Lake, classes: Collection[str], *, dataset: str | None, split: str | None,
    repository: str | None, column: str,
) -> RealClips:  # fmt: skip
    """The clips of a generator's classes: those of one split to test, those of another as training clips.

    Where no labelled clip is of these splits and none is asked for, every clip is both, and no clip is compared with
    itself.

    Args:
        con: to the lake.
        lake: for the frames.
        classes: the generator's.
        dataset: its clips only.
        split, repository: values of the column split; "test" and "train" where they are not given.
        column: what says the class of clips.

    Raises:
        UserError: no such column or split, no labelled clips, or none of the generator's classes.
    """
    check_column(con, column)
    found = fetch(con, "synthesis_clips", {"dataset": dataset, "column": column})
    rows = [_Row(**{**row, "rest_offsets": tuple(row["rest_offsets"])}) for row in found]
    if not rows:
        where = f" of dataset {dataset}" if dataset else ""
        raise UserError(f"no clip{where} has a {column}; synthesis is measured by labelled clips (labels.csv)")
    asked, known = split or QUERIES, repository or REPOSITORY
    test, training = ([row for row in rows if row.split == name] for name in (asked, known))
    alone = split is None and repository is None and not (test and training)
    if alone:
        test = training = rows
    for name, of_it in ((asked, test), (known, training)):
        if not of_it:
            splits = sorted({row.split for row in rows if row.split})
            raise UserError(f"no labelled clip has split {name}; there are {', '.join(splits) or 'no splits'}")
    kept = [row for row in test if row.label in classes]
    if not kept:
        raise UserError(
            f"none of the {len(test)} clips to test by is of a class that the generator knows "
            f"({', '.join(sorted(classes)[:5])}{', …' if len(classes) > 5 else ''}); --label-column names another "
            "column of labels.csv"
        )
    strangers = len(test) - len(kept)
    kept = _spread(kept, MOST_TEST)
    learned = _spread([row for row in training if row.label in classes], MOST_TRAINING)
    motions = _motions(lake, list(dict.fromkeys([*kept, *learned])))
    return RealClips(
        [motions[row] for row in kept], [motions[row] for row in learned],
        LEAVE_ONE_OUT if alone else f"{asked} clips, {known} clips known", None if alone else asked,
        strangers,
    )  # fmt: skip


def _spread(rows: Sequence[_Row], most: int) -> list[_Row]:
    if len(rows) <= most:
        return list(rows)
    return [rows[i] for i in np.linspace(0, len(rows) - 1, most).round().astype(int).tolist()]


def _motions(lake: Lake, rows: Sequence[_Row]) -> dict[_Row, RealMotion]:
    ranges: dict[str, list[_Row]] = {}
    for row in rows:
        ranges.setdefault(row.clip, []).append(row)
    return {
        row: RealMotion(
            name, row.dataset, row.label, positions[row.start : row.stop], fps,
            np.asarray(row.rest_offsets, dtype=np.float64).reshape(-1, 3),
        )
        for name, fps, positions in read_positions(lake, [some[0] for some in ranges.values()])
        for row in ranges[name]
    }  # fmt: skip

"""Which clips of a lake a network is trained on, and their frames: all, or those of a dataset or of a split."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from motionlake.errors import UserError
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.verdicts import good_rows
from numpy.typing import ArrayLike

Row = Mapping[str, Any]


def chosen_clips(
    con: Connection,
    lake: Lake,
    split: str | None,
    dataset: str | None,
    query: str = "training_clips",
    *,
    min_quality: str | None = None,
) -> list[dict[str, Any]]:
    """The rows of a query for the recorded clips of a split and of a dataset; none where the lake has no clips.

    Args:
        con: to the lake.
        lake: named in errors.
        split: as the column `split` of labels.csv has it; None takes every clip.
        dataset: None takes all.
        query: that reads `split` and `dataset`.
        min_quality: the worst verdict that a clip may have (`lake.verdicts`); None takes any.

    Raises:
        UserError: there is no such dataset or split, no clip is as good, or verdicts are not known.
    """
    rows = fetch(con, query, {"split": split, "dataset": dataset, "label": None})
    if not rows:
        check_chosen(con, lake, split, dataset)
    return good_rows(con, rows, min_quality, "clips to train on")


def check_chosen(con: Connection, lake: Lake, split: str | None, dataset: str | None) -> None:
    """Raises `UserError` where the lake has recorded clips, but none of such a dataset or split."""
    held = fetch(con, "splits")
    if not held:
        return
    datasets = sorted({row["dataset"] for row in held})
    if dataset is not None and dataset not in datasets:
        raise UserError(f"{dataset}: no such dataset in {lake.root}; it holds {', '.join(datasets)}")
    known = sorted({row["split"] for row in held if row["split"] and dataset in (None, row["dataset"])})
    if split is None or split in known:
        return
    where = f"{lake.root}, dataset {dataset}" if dataset else f"{lake.root}"
    if known:
        raise UserError(f"{where}: no clip is of split {split!r}; the splits there are: {', '.join(known)}")
    raise UserError(f"{where}: no clip has a split; the column `split` of labels.csv says which clip is of which")


def drawn_clips(
    rows: list[dict[str, Any]], lengths: ArrayLike, seed: int, most_frames: int, most_clips: int | None = None
) -> list[dict[str, Any]]:
    """So many rows, drawn at random, that they hold at most `most_frames`; in their order.

    Args:
        rows: n.
        lengths: [n] frames of each.
        seed: of the draw.
        most_frames: of all rows drawn.
        most_clips: at most so many rows.
    """
    order = np.random.default_rng(seed).permutation(len(rows))
    within = order[np.cumsum(np.asarray(lengths)[order]) <= most_frames][:most_clips]
    return [rows[i] for i in sorted(within.tolist())]


def frames_of_clips(lake: Lake, rows: Sequence[Row]) -> Iterator[frames.Frames]:
    """The frames of the clips that rows name (`clip`, `dataset`, `part`), each once; each part is read once."""
    for dataset, part in sorted({(row["dataset"], row["part"]) for row in rows}):
        path = sound(lake, lake.frames_part(dataset, part))
        yield from frames.read_clips(path, sorted({row["clip"] for row in rows if row["part"] == part}))

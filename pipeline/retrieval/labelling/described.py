"""Clips of a lake that have a descriptor, with the labels that a column gives them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.retrieval.labelling.signed import check_column


@dataclass(frozen=True)
class DescribedClip:
    """One labelled clip that has a descriptor; `part` holds its frames, at `fps`."""

    clip: str
    dataset: str
    part: str
    fps: float
    split: str | None
    content_hash: str
    label: str


@dataclass(frozen=True)
class DescribedClips:
    """n clips, their descriptors [n, 512], and the signature [K] of each that has one."""

    clips: list[DescribedClip]
    descriptors: Float32Array
    signatures: list[list[float] | None]

    @property
    def labels(self) -> list[str]:
        """[n] labels."""
        return [clip.label for clip in self.clips]


def described_clips(con: Connection, dataset: str | None = None, column: str = "label") -> DescribedClips:
    """The lake's labelled clips that have a descriptor, by name.

    Args:
        con: to the lake.
        dataset: of this dataset only.
        column: what becomes their label: "label", "subject", "split", "dataset" or a column of labels.csv.

    Raises:
        UserError: no such column, no descriptors, or no labelled clip that has one.
    """
    check_column(con, column)
    if not fetch(con, "served_descriptors"):
        raise UserError("the lake has no descriptors yet; make them with `motionlake run all`")
    rows = fetch(con, "described_clips", {"dataset": dataset, "column": column})
    if not rows:
        where = f" of dataset {dataset}" if dataset else ""
        raise UserError(f"no clip{where} with a {column} has a descriptor; `motionlake status` shows what there is")
    descriptors = np.array([row.pop("descriptor") for row in rows], dtype=np.float32)
    signatures = [row.pop("signature") for row in rows]
    return DescribedClips([DescribedClip(**row) for row in rows], descriptors, signatures)

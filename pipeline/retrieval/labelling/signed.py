"""Clips of a lake that have a signature, with the labels that a column gives them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.emd import ground_distances
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch


@dataclass(frozen=True)
class SignedClip:
    """One clip that has a signature; `part` holds its frames, at `fps`."""

    clip: str
    dataset: str
    path: str
    part: str
    fps: float
    subject: str | None
    label: str | None


@dataclass(frozen=True)
class SignedClips:
    """n clips, and their signatures [n, K]."""

    clips: list[SignedClip]
    signatures: Float32Array

    def labelled(self) -> SignedClips:
        """Those with a label."""
        at = [i for i, clip in enumerate(self.clips) if clip.label is not None]
        return SignedClips([self.clips[i] for i in at], self.signatures[at])

    @property
    def labels(self) -> list[str]:
        """[n] labels; "" where there is none."""
        return [clip.label or "" for clip in self.clips]


def signed_clips(
    con: Connection,
    dataset: str | None = None,
    column: str = "label",
    only: tuple[str, str] | None = None,
    *,
    real: bool = False,
) -> SignedClips:
    """The lake's clips that have a signature, by name.

    Args:
        con: to the lake.
        dataset: of this dataset only.
        column: what becomes their label: "label", "subject", "split", "dataset" or a column of labels.csv.
        only: a column and the value it must have.
        real: leave synthetic clips out.

    Raises:
        UserError: no such column, or no signed clip.
    """
    check_column(con, column)
    if only is not None:
        check_column(con, only[0])
    parameters = {
        "dataset": dataset,
        "column": column,
        "only_column": only and only[0],
        "only_value": only and only[1],
        "real": real,
    }
    rows = fetch(con, "labelled_clips", parameters)
    if not rows:
        where = f" of dataset {dataset}" if dataset else ""
        where += f" with {only[0]} = {only[1]}" if only else ""
        raise UserError(f"no clip{where} has a signature; `motionlake status` shows what there is")
    signatures = np.array([row.pop("signature") for row in rows], dtype=np.float32)
    return SignedClips([SignedClip(**row) for row in rows], signatures)


def check_column(con: Connection, column: str) -> None:
    """Raises `UserError` where no clip has such a column."""
    known = [r["name"] for r in fetch(con, "label_columns")]
    if column not in known:
        raise UserError(f"{column}: no such column of labels; there are {', '.join(known)}")


def lake_ground(con: Connection) -> Float64Array:
    """[K, K] distances of the lake's motifs. Raises `UserError` where it has none."""
    rows = fetch(con, "corpus_motifs")
    if not rows:
        raise UserError("the lake has no motifs yet; make them with `motionlake run all`")
    return ground_distances(np.array([r["centroid"] for r in rows], dtype=np.float32))

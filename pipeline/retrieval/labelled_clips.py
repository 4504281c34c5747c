"""Clips of a lake that have a signature, a string or a descriptor, with the labels that a column gives them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deep_motifs.emd import ground_distances
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.verdicts import good_rows
from motionlake.retrieval.protocol import EVERYTHING, ClipFilter


@dataclass(frozen=True, kw_only=True)
class FramedClip:
    """A clip of a lake; `part` holds its frames, at `fps`."""

    clip: str
    dataset: str
    part: str
    fps: float


@dataclass(frozen=True, kw_only=True)
class SignedClip(FramedClip):
    """One clip that has a signature."""

    path: str
    subject: str | None
    label: str | None


@dataclass(frozen=True)
class SignedClips:
    """n clips, and their signatures [n, K]."""

    clips: list[SignedClip]
    signatures: Float32Array

    def chosen(self, wanted: Sequence[bool]) -> SignedClips:
        """Those of n clips that are wanted."""
        return SignedClips(list(compress(self.clips, wanted)), self.signatures[list(wanted)])

    def labelled(self) -> SignedClips:
        """Those with a label."""
        return self.chosen([clip.label is not None for clip in self.clips])

    @property
    def labels(self) -> list[str]:
        """[n] labels; "" where there is none."""
        return [clip.label or "" for clip in self.clips]


def signed_clips(
    con: Connection, scope: ClipFilter = EVERYTHING, column: str = "label", only: tuple[str, str] | None = None
) -> SignedClips:
    """The lake's clips that have a signature, by name.

    Args:
        con: to the lake.
        scope: which clips.
        column: what becomes their label: "label", "subject", "split", "dataset" or a column of labels.csv.
        only: a column and the value it must have.

    Raises:
        UserError: no such column, or no signed clip.
    """
    rows = _chosen(con, "labelled_clips", "a signature", scope, column, only)
    signatures = np.array([row.pop("signature") for row in rows], dtype=np.float32)
    return SignedClips([SignedClip(**row) for row in rows], signatures)


def _chosen(
    con: Connection, statement: str, what: str, scope: ClipFilter, column: str, only: tuple[str, str] | None
) -> list[dict[str, Any]]:
    check_column(con, column)
    if only is not None:
        check_column(con, only[0])
    chosen = {"column": column, "only_column": only and only[0], "only_value": only and only[1]}
    rows = fetch(con, statement, scope.as_parameters(con) | chosen)
    if not rows:
        where = f" of dataset {scope.dataset}" if scope.dataset else ""
        where += f" of split {scope.split}" if scope.split else ""
        where += f" with {only[0]} = {only[1]}" if only else ""
        raise UserError(f"no clip{where} has {what}; `motionlake status` shows what there is")
    return rows


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


@dataclass(frozen=True, kw_only=True)
class CodedClip(FramedClip):
    """One clip that has a symbol string."""

    label: str | None


@dataclass(frozen=True)
class CodedClips:
    """n clips, and the signature [K] of each that has one."""

    clips: list[CodedClip]
    signatures: list[list[float] | None]

    def labelled(self) -> CodedClips:
        """Those with a label."""
        wanted = [clip.label is not None for clip in self.clips]
        return CodedClips(list(compress(self.clips, wanted)), list(compress(self.signatures, wanted)))

    @property
    def labels(self) -> list[str]:
        """[n] labels; "" where there is none."""
        return [clip.label or "" for clip in self.clips]


def coded_clips(
    con: Connection, scope: ClipFilter = EVERYTHING, column: str = "label", only: tuple[str, str] | None = None
) -> CodedClips:
    """The lake's clips that have a symbol string, by name; arguments and errors as of `signed_clips`."""
    rows = _chosen(con, "labelled_strings", "a symbol string", scope, column, only)
    signatures = [row.pop("signature") for row in rows]
    return CodedClips([CodedClip(**row) for row in rows], signatures)


@dataclass(frozen=True, kw_only=True)
class DescribedClip(FramedClip):
    """One labelled clip that has a descriptor."""

    split: str | None
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


def described_clips(
    con: Connection, dataset: str | None = None, column: str = "label", min_quality: str | None = None
) -> DescribedClips:
    """The lake's labelled clips that have a descriptor, by name.

    Args:
        con: to the lake.
        dataset: of this dataset only.
        column: what becomes their label: "label", "subject", "split", "dataset" or a column of labels.csv.
        min_quality: the worst verdict of stage "quality" that a clip may have; None: any.

    Raises:
        UserError: no such column, no descriptors, no labelled clip that has one, or as `good_rows`.
    """
    check_column(con, column)
    if not fetch(con, "served_descriptors"):
        raise UserError("the lake has no descriptors yet; make them with `motionlake run all`")
    rows = fetch(con, "described_clips", {"dataset": dataset, "column": column})
    if not rows:
        where = f" of dataset {dataset}" if dataset else ""
        raise UserError(f"no clip{where} with a {column} has a descriptor; `motionlake status` shows what there is")
    rows = good_rows(con, rows, min_quality, "labelled clips")
    descriptors = np.array([row.pop("descriptor") for row in rows], dtype=np.float32)
    signatures = [row.pop("signature") for row in rows]
    return DescribedClips([DescribedClip(**row) for row in rows], descriptors, signatures)

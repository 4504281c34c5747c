"""Retrieval of whole clips by their signatures, for clips of the lake and for files outside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from motionlake.deep_motifs.emd import check_model, check_signature
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.retrieval.encode import serving_models, signature_of_motifs, words_of_file
from motionlake.stages.sources import IngestOptions
from numpy.typing import NDArray


@dataclass(frozen=True)
class Hit:
    """One answer: its rank from 1, the clip, and its distance from the query.

    Attributes:
        mirrored: the mirrored query is nearer than the query itself; None where it was not asked for.
    """

    rank: int
    clip: str
    distance: float
    label: str | None
    dataset: str
    seconds: float
    mirrored: bool | None = None

    def as_row(self) -> dict[str, object]:
        row = asdict(self)
        if self.mirrored is None:
            del row["mirrored"]
        return row


def similar_to_clip(
    con: Connection, clip: str, k: int, dataset: str | None = None, *, mirrored: bool = False, real: bool = False
) -> list[Hit]:
    """The k clips nearest to a clip of the lake by signature; the clip itself is left out.

    With `mirrored`, nearest to the clip or to its mirror image. With `real`, synthetic clips are left out.

    Raises:
        UserError: the clip has no signature yet.
    """
    there, query = ("has_signature", "search_clip")
    if mirrored:
        there, query = ("has_mirrored_signature", "search_clip_or_mirrored")
    if not fetch(con, there, {"clip": clip}):
        kind = "mirrored signature" if mirrored else "signature"
        raise UserError(f"{clip}: has no {kind} yet; make it with `motionlake run all`")
    return _hits(con, query, {"clip": clip, "k": k, "dataset": dataset, "real": real})


def similar_to_file(
    con: Connection,
    lake: Lake,
    path: Path,
    k: int,
    dataset: str | None = None,
    *,
    mirrored: bool = False,
    real: bool = False,
) -> list[Hit]:
    """The k clips nearest to a clip file that need not be in the lake (its first body).

    With `mirrored`, nearest to the clip or to its mirror image. With `real`, synthetic clips are left out.

    Raises:
        UserError: the file cannot be read, or the lake has no motifs yet.
    """
    parameters: dict[str, object] = {"k": k, "dataset": dataset, "real": real}
    if not mirrored:
        parameters["signature"] = signature_of_file(con, lake, path).tolist()
        return _hits(con, "search_signature", parameters)
    models = serving_models(con, lake)
    features = words_of_file(lake, models.config.words, path).features
    parameters["signature"] = signature_of_motifs(con, models.motifs_of(features)).tolist()
    parameters["mirrored"] = signature_of_motifs(con, models.mirrored_motifs_of(features)).tolist()
    return _hits(con, "search_signature_or_mirrored", parameters)


def similar_to_signature(
    con: Connection,
    signature: NDArray[np.floating],
    k: int,
    dataset: str | None = None,
    model: str | None = None,
    *,
    real: bool = False,
) -> list[Hit]:
    """The k clips nearest to a signature [K] made with the lake's motifs (`model`, where their name is known).

    With `real`, synthetic clips are left out.

    Raises:
        UserError: the lake has no motifs yet, or the signature is over others.
    """
    served = fetch(con, "corpus_motifs")
    if not served:
        raise UserError("the lake has no motifs yet; make them with `motionlake run all`")
    try:
        check_model(model, served[0]["model"])
        check_signature(signature, len(served))
    except ValueError as error:
        raise UserError(f"{error} (`signature_of_file` makes one that fits)") from error
    parameters = {"signature": signature.tolist(), "k": k, "dataset": dataset, "real": real}
    return _hits(con, "search_signature", parameters)


def signature_of_file(con: Connection, lake: Lake, path: Path, options: IngestOptions | None = None) -> np.ndarray:
    """[K] signature of a file's first body under the lake's frozen models."""
    models = serving_models(con, lake)
    file = words_of_file(lake, models.config.words, path, options)
    return signature_of_motifs(con, models.motifs_of(file.features))


def _hits(con: Connection, query: str, parameters: dict[str, object]) -> list[Hit]:
    rows: Sequence[dict[str, object]] = fetch(con, query, parameters)
    return [Hit(**row) for row in rows]  # type: ignore[arg-type]

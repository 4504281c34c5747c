"""The retrieval methods by name."""

from __future__ import annotations

import os
from typing import Final

from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.retrieval.protocol import Retriever

SINGLE: Final = ("signature", "alignment", "descriptor")
METHODS: Final = (*SINGLE, "fused")


def retriever(method: str, con: Connection, lake: Lake, *, mirrored: bool = False, real: bool = False) -> Retriever:
    """A way to retrieve the whole clips of a lake.

    Args:
        method: of `METHODS`; "fused" takes those that the lake is ready for.
        con: with functions and macros, as `motionlake.connect` opens it.
        lake: which holds the models for files.
        mirrored: nearest to the clip or to its mirror image, by signature only.
        real: synthetic clips are no answers.

    Raises:
        UserError: an unknown method, one that the lake is not ready for, or `mirrored` by another than signature.
    """
    check_method(method, mirrored=mirrored)
    if method == "signature":
        from motionlake.retrieval.signature import SignatureRetriever

        return SignatureRetriever(con, lake, mirrored=mirrored, real=real)
    if method == "alignment":
        from motionlake.retrieval.alignment_searcher import AlignmentRetriever

        return AlignmentRetriever(con, lake, threads=os.cpu_count() or 1, real=real)
    if method == "descriptor":
        from motionlake.retrieval.descriptor import DescriptorRetriever

        return DescriptorRetriever(con, lake, real=real)
    from motionlake.retrieval.fused import FusedRetriever

    ready = ready_methods(con)
    if not ready:
        raise UserError(f"{lake.root}: is not ready for search; make it so with `motionlake run all`")
    return FusedRetriever([retriever(name, con, lake, real=real) for name in ready])


def check_method(method: str, *, mirrored: bool = False) -> None:
    """Raises `UserError` for an unknown method, or `mirrored` by another than signature."""
    if method not in METHODS:
        raise UserError(f"--method {method}: not one of {', '.join(METHODS)}")
    if mirrored and method != "signature":
        raise UserError(f"--mirrored: searches by signature, not by {method}; leave one of the two out")


def ready_methods(con: Connection) -> list[str]:
    """Those of `SINGLE` whose tables the lake has."""
    from motionlake.stages.descriptors import served_network

    ready = {
        "signature": bool(fetch(con, "corpus_motifs")),
        "alignment": bool(fetch(con, "posture_codes")),
        "descriptor": served_network(con) is not None,
    }
    return [name for name in SINGLE if ready[name]]

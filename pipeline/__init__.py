"""motionlake: motion capture repositories as Parquet frames and DuckDB tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from motionlake.lake.clip_dataset import ClipDataset
    from motionlake.retrieval.connection import connect

__all__ = ["ClipDataset", "connect"]


def __getattr__(name: str) -> Any:
    # Readers and kernels must not pay for the imports that a connection or a network needs.
    if name == "connect":
        from motionlake.retrieval.connection import connect

        return connect
    if name == "ClipDataset":
        from motionlake.lake.clip_dataset import ClipDataset

        return ClipDataset
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""motionlake: motion capture repositories as Parquet frames and DuckDB tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipeline.clip_dataset import ClipDataset
    from pipeline.connection import connect

__all__ = ["ClipDataset", "connect"]


def __getattr__(name: str) -> Any:
    # Readers and kernels must not pay for the imports that a connection or a network needs.
    if name == "connect":
        from pipeline.connection import connect

        return connect
    if name == "ClipDataset":
        from pipeline.clip_dataset import ClipDataset

        return ClipDataset
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

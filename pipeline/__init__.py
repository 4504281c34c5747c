"""motionlake: motion capture repositories as Parquet frames and DuckDB tables.

`open_lake(path)` opens a lake; what can be asked of it are the methods of `Lake`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

from motionlake import caches

if TYPE_CHECKING:
    from motionlake.api import Lake, open_lake
    from motionlake.errors import UserError
    from motionlake.lake.clip_dataset import ClipDataset, collate
    from motionlake.lake.rows import Rows
    from motionlake.motion.canonicalise import CanonicalMotion
    from motionlake.pictures.answers import Hits
    from motionlake.retrieval.sql_functions import connect

__all__ = ["CanonicalMotion", "ClipDataset", "Hits", "Lake", "Rows", "UserError", "collate", "connect", "open_lake"]

# Imported where first used: readers and kernels must not pay for what a connection or a network needs.
_HOMES: Final = {
    "CanonicalMotion": "motion.canonicalise",
    "ClipDataset": "lake.clip_dataset",
    "Hits": "pictures.answers",
    "Lake": "api",
    "Rows": "lake.rows",
    "UserError": "errors",
    "collate": "lake.clip_dataset",
    "connect": "retrieval.sql_functions",
    "open_lake": "api",
}

caches.settle()  # before numba is imported by anything


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

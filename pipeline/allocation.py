"""Memory that a process frees and takes again."""

from __future__ import annotations

import ctypes
import os
import sys
from functools import cache
from typing import Final

MIB: Final = 2**20
# Of mallopt(3). The C library takes no larger threshold than half of a heap of its threads.
_TRIM, _TRIM_BYTES = -1, 512 * MIB
_MMAP, _MMAP_BYTES = -3, 32 * MIB
_SET_BY_USER: Final = ("MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_", "GLIBC_TUNABLES")


@cache
def keep_freed() -> bool:
    """Have this process keep what it frees for what it takes next; whether that was done, once a process.

    Arrays of a clip have some hundred kB. By default the C library gives memory of that size back to the system when it
    is freed, which clears each page anew when it is taken again. Nothing is done where the C library is none of GNU's,
    or where the environment says what it is to do.
    """
    if not sys.platform.startswith("linux") or any(name in os.environ for name in _SET_BY_USER):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return False
    return bool(mallopt(_MMAP, _MMAP_BYTES)) and bool(mallopt(_TRIM, _TRIM_BYTES))

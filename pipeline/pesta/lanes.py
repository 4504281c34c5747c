"""How many numbers the kernels of alignment work on at once; apart from these, so that nobody waits for a compiler."""

from functools import cache
from typing import Final

LANES: Final = 16
ROWS: Final = LANES // 2  # of the query, whose distances are loaded at once
# Strides whose window is written out in full; a wider window is a loop.
MAX_UNROLLED: Final = 3


@cache
def strip_lanes() -> int:
    """Strips of a long query side by side: what they carry along should fit the processor's registers."""
    from llvmlite.binding import get_host_cpu_features

    return LANES if get_host_cpu_features().get("avx512f") else LANES // 2

"""How many numbers the kernels of alignment work on at once; apart from these, so that nobody waits for a compiler."""

from typing import Final

LANES: Final = 16
ROWS: Final = LANES // 2  # of the query, whose distances are loaded at once
# Strides whose window is written out in full; a wider window is a loop.
MAX_UNROLLED: Final = 3

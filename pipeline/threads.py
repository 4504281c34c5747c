"""How many threads linear algebra runs on."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager
from functools import lru_cache

from threadpoolctl import ThreadpoolController


def limited(count: int) -> AbstractContextManager[object]:
    """Within the block, the libraries of linear algebra that are loaded by now run on so many threads.

    To look for them takes milliseconds, more than the work of a clip, so it is done again only where modules were
    imported since.
    """
    within: AbstractContextManager[object] = _libraries(len(sys.modules)).limit(limits=count)
    return within


@lru_cache(maxsize=1)
def _libraries(_modules: int) -> ThreadpoolController:
    return ThreadpoolController()

"""How many threads a computation takes, whatever the machine or its environment says."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from threadpoolctl import threadpool_limits


@contextmanager
def on_threads(count: int) -> Iterator[None]:
    """So many threads for torch and for numpy's linear algebra."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        with threadpool_limits(limits=count):
            yield
    finally:
        torch.set_num_threads(before)

"""POT's compiled network simplex without the rest of POT, whose import takes longer than a search."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from motionlake.arrays import Float64Array

MOST_STEPS: Final = 100_000  # of the simplex, as POT allows


def cheapest_flow(sources: Float64Array, sinks: Float64Array, costs: Float64Array) -> float:
    """Cost of moving `sources` [s] to `sinks` [t], of the same total, at `costs` [s, t]: that of `ot.emd2`.

    Args:
        sources: positive.
        sinks: positive.
        costs: C-contiguous.
    """
    found = _simplex()(sources, sinks * sources.sum() / sinks.sum(), costs, MOST_STEPS, 1)
    return float(found[1])


@cache
def _simplex() -> Callable[..., tuple[Any, ...]]:
    """`ot.lp.emd_wrap.emd_c`: (plan, cost, ...)."""
    if "ot" not in sys.modules:
        spec = find_spec("ot")
        assert spec is not None
        assert spec.origin is not None
        root = Path(spec.origin).parent
        packages = {"ot": root, "ot.lp": root / "lp", "ot.utils": root}
        try:
            for name, folder in packages.items():  # empty ones: their __init__ imports scikit-learn and much more
                sys.modules[name] = _Empty(name)
                sys.modules[name].__path__ = [str(folder)]
            importlib.import_module("ot.lp.emd_wrap")
        finally:
            for name in packages:
                del sys.modules[name]
    else:
        importlib.import_module("ot.lp.emd_wrap")
    solver: Callable[..., tuple[Any, ...]] = sys.modules["ot.lp.emd_wrap"].emd_c
    return solver


class _Empty(ModuleType):
    """A package whose functions are imported when they are called."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        home = self.__name__
        return lambda *given, **named: getattr(importlib.import_module(home), name)(*given, **named)

"""Kernels that are compiled, or read from disk, when they are first called: to import numba takes half a second, which
a command that calls none need not wait for.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection
from functools import update_wrapper
from threading import RLock
from typing import Any, Final, ParamSpec, TypeVar, cast

Given = ParamSpec("Given")
Found = TypeVar("Found")
_ONE_AT_A_TIME: Final = RLock()
FEW: Final = 1 << 25  # cells of alignments that NumPy works out in less than the time in which numba is imported
_worked_out = 0


class Kernel:
    """A function that numba compiles. Other kernels may call it, and what numba's has, it has.

    Args:
        function: to compile.
        how: arguments of `numba.njit`.
    """

    def __init__(self, function: Callable[..., Any], how: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self._function, self._how = function, how
        self._compiled: Any = None

    def __call__(self, *given: Any) -> Any:
        return (self._compiled or self._made())(*given)

    def _made(self) -> Any:
        with _ONE_AT_A_TIME:
            if self._compiled is None:
                from motionlake.compiler import njit as compiler

                self._compiled = compiler(**self._how)(self._function)
        return self._compiled

    @property
    def _numba_type_(self) -> Any:
        """What numba asks for where a kernel calls this one."""
        from numba import types

        return types.Dispatcher(self._made())

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # what Python asks of any object, and numba's need not be made for
            raise AttributeError(name)
        return getattr(self._made(), name)

    def __reduce__(self) -> Any:
        """By its name. Where a function made it, by that and what it was made with: numba so names the kernel on disk
        of one that calls it; with numba's own in its place it would compile that anew in every process."""
        function = self._function
        if "<locals>" not in function.__qualname__:
            return function.__qualname__
        made_with = [cell.cell_contents for cell in function.__closure__ or ()]
        return _unknown, (function.__module__, function.__qualname__, sorted(self._how.items()), made_with)


def few(cells: int) -> bool:
    """Whether so many cells of an alignment are worked out sooner by NumPy than by a kernel: they are the first ones of
    a process that has not imported numba."""
    global _worked_out
    if "numba" in sys.modules:
        return False
    with _ONE_AT_A_TIME:
        _worked_out += cells
        return _worked_out <= FEW


def expect_many() -> None:
    """No cells are few from now on: in a process that will answer many, nobody is to wait for numba in their midst."""
    global _worked_out
    with _ONE_AT_A_TIME:
        _worked_out = FEW + 1


def _unknown(module: str, name: str, *_: object) -> Kernel:
    raise TypeError(f"{module}.{name}: a kernel that a function makes is made again by calling it")


def njit(
    *,
    cache: bool = False,
    nogil: bool = False,
    inline: str = "never",
    fastmath: bool | Collection[str] = False,
    error_model: str = "python",
) -> Callable[[Callable[Given, Found]], Callable[Given, Found]]:
    """`numba.njit`, at the first call. Arguments of the function are given by place."""
    how = {"cache": cache, "nogil": nogil, "inline": inline, "fastmath": fastmath, "error_model": error_model}

    def kernel(function: Callable[Given, Found]) -> Callable[Given, Found]:
        return cast(Callable[Given, Found], Kernel(function, how))

    return kernel

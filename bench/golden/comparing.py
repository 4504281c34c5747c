"""What differs between two golden records, entry by entry."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from bench.golden.commands import RENAMED


def differences(
    old: Any, new: Any, *, renamed: Mapping[str, str] = RENAMED, relative: float = 0.0, absolute: float = 0.0
) -> list[str]:
    """A line for each entry that differs; fractions may differ by the given amounts."""
    before = {_renamed(name, renamed): value for name, value in entries(old)}
    after = dict(entries(new))
    lines = []
    for name in [*before, *(name for name in after if name not in before)]:
        if name not in after:
            lines.append(f"{name}: gone (was {_short(before[name])})")
        elif name not in before:
            lines.append(f"{name}: new ({_short(after[name])})")
        elif not _same(before[name], after[name], relative, absolute):
            lines.append(f"{name}: {_short(before[name])} → {_short(after[name])}")
    return lines


def entries(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Every leaf of nested JSON, named by the way to it."""
    pairs: Iterator[tuple[Any, Any]]
    if isinstance(value, dict) and value:
        pairs = iter(value.items())
    elif isinstance(value, list) and value:
        pairs = iter(enumerate(value))
    else:
        yield name, value
        return
    for key, each in pairs:
        # A slash within a key is none between two.
        part = str(key).replace("/", "∕")
        yield from entries(each, f"{name}/{part}" if name else part)


def _renamed(name: str, renamed: Mapping[str, str]) -> str:
    for old, new in renamed.items():
        if "/" in old and (name == old or name.startswith(f"{old}/")):
            name = new + name[len(old) :]
    return "/".join(renamed.get(part, part) for part in name.split("/"))


def _same(old: Any, new: Any, relative: float, absolute: float) -> bool:
    if isinstance(old, float) or isinstance(new, float):
        try:
            return math.isclose(old, new, rel_tol=relative, abs_tol=absolute)
        except TypeError:
            return False
    return bool(old == new) and type(old) is type(new)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."

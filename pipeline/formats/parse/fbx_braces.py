"""Kernel that counts the braces of FBX as text."""

from __future__ import annotations

from motionlake.kernels import njit


@njit(cache=True)
def open_braces(data):  # type: ignore[no-untyped-def]
    """Opening less closing braces of text, uint8 [n]; those in words and in remarks (`;`) are none."""
    opened = i = 0
    end, last_quote = len(data), -1
    for at in range(end - 1, -1, -1):
        if data[at] == 34:
            last_quote = at
            break
    while i < end:
        byte = data[i]
        if byte == 34 and i < last_quote:
            i += 1
            while data[i] != 34:
                i += 1
        elif byte == 59:
            while i + 1 < end and data[i + 1] != 10:
                i += 1
        elif byte == 123:
            opened += 1
        elif byte == 125:
            opened -= 1
        i += 1
    return opened

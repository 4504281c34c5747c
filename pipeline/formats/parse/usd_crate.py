"""Binary USD layers (.usdc): what every path of a file has.

Such a file is a table of sections: words (tokens), paths as a tree of words, fields (a word and where its value is),
sets of fields, and specs, each of which gives a path its set. Every count and place is held against the file before it
is used.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Final

from motionlake.formats.parse.usd_packed import Bytes, NotPlainError, unpacked

MAGIC: Final = b"PXR-USDC"
_HEAD: Final = struct.Struct("<8s8BQ")
_SECTION: Final = struct.Struct("<16sQQ")
# Before minor version 7 arrays have no count of eight bytes; what comes after 13 nobody knows.
_MINOR: Final = range(7, 14)
_MOST: Final = 20_000  # paths, fields or sections; of larger scenes the library finds the skeletons sooner
_MOST_TEXT: Final = 1 << 24  # characters of all paths
_SETS_END: Final = -1  # of four bytes
_KINDS: Final = frozenset((1, 6, 7, 8))  # of specs: attribute, prim, the layer itself, relationship


class Crate:
    """A layer.

    Attributes:
        data: the file.
        words: its tokens.
        paths: of all its specs, by their numbers; "" where a number is no path of a prim or a property.
        fields: for each path, its fields by name: where and how the value lies, of eight bytes.
    """

    def __init__(self, data: bytes) -> None:
        self.data = memoryview(data)
        sections = self._sections()
        self.words = _words(sections["TOKENS"])
        self.paths = _paths(sections["PATHS"], self.words)
        names, values = _fields(sections["FIELDS"])
        used = [self.words[name] for name in names]
        self.fields: dict[str, dict[str, int]] = {}
        sets = {
            begin: {used[field]: values[field] for field in chosen}
            for begin, chosen in _sets(sections["FIELDSETS"]).items()
        }
        for path, begin in _specs(sections["SPECS"]):
            self.fields[self.paths[path]] = sets[begin]

    def _sections(self) -> dict[str, Bytes]:
        if len(self.data) < _HEAD.size:
            raise NotPlainError("ends early")
        magic, major, minor, *_, place = _HEAD.unpack_from(self.data)
        if magic != MAGIC or major or minor not in _MINOR:
            raise NotPlainError("is of another version")
        table = Bytes(self.data[place:])
        count = table.number()
        if count > _MOST:
            raise NotPlainError("has too many sections")
        found = {}
        for _ in range(count):
            name, begin, size = _SECTION.unpack(table.take(_SECTION.size))
            if begin + size > len(self.data):
                raise NotPlainError("ends early")
            found[name.rstrip(b"\0").decode("ascii")] = Bytes(self.data[begin : begin + size])
        return found


def _counted(section: Bytes) -> int:
    count = section.number()
    if count > _MOST:
        raise NotPlainError("is large")
    return count


def _words(section: Bytes) -> list[str]:
    count, size, packed = _counted(section), section.number(), section.number()
    words = unpacked(section.take(packed), size).split(b"\0")
    if len(words) != count + 1:
        raise NotPlainError("has other words than it says")
    return [word.decode() for word in words[:-1]]


def _fields(section: Bytes) -> tuple[list[int], list[int]]:
    """Of each field the number of its name, and its value."""
    count = _counted(section)
    names = section.integers(count)
    return names, list(struct.unpack(f"<{count}Q", unpacked(section.take(section.number()), 8 * count)))


def _sets(section: Bytes) -> dict[int, list[int]]:
    """The numbers of the fields of each set, by where it begins: one comes after the other, each with an end."""
    members, found, begin = section.integers(_counted(section)), dict[int, list[int]](), 0
    for at, member in enumerate(members):
        if member == _SETS_END:
            found[begin], begin = members[begin:at], at + 1
    return found


def _specs(section: Bytes) -> list[tuple[int, int]]:
    """For each spec the number of its path, and where its set of fields begins; of no kinds but those of `_KINDS`."""
    count = _counted(section)
    paths, sets, kinds = (section.integers(count) for _ in range(3))
    if not _KINDS.issuperset(kinds):
        raise NotPlainError("has variants or the like")
    return list(zip(paths, sets, strict=True))


def _paths(section: Bytes, words: Sequence[str]) -> list[str]:
    """Paths by their numbers: a tree, in which a node's first child comes after it, and its next sibling at a jump."""
    count = _counted(section)
    encoded = section.number()
    if encoded > count:
        raise NotPlainError("has more paths than it says")
    numbers, elements, jumps = (section.integers(encoded) for _ in range(3))
    found = [""] * count
    waiting: list[tuple[int, str | None]] = [(0, None)]
    seen = written = 0
    while waiting:
        at, above = waiting.pop()
        while True:
            seen += 1
            if seen > encoded or not 0 <= at < encoded or not 0 <= numbers[at] < count:
                raise NotPlainError("has paths that are no tree")
            word = words[abs(elements[at])]
            path = _below(above, word, elements[at] < 0)
            written += len(path)
            if written > _MOST_TEXT:  # of a tree that is as deep as it has nodes, paths take the square of them
                raise NotPlainError("has paths that are too long")
            found[numbers[at]] = path
            jump = jumps[at]
            if jump > 0:  # both: the sibling is further on
                waiting.append((at + jump, above))
            if jump == 0:  # a sibling, which is next
                at += 1
                continue
            if jump != -2:
                at, above = at + 1, path
                continue
            break
    return found


def _below(above: str | None, word: str, is_property: bool) -> str:
    if above is None:
        return "/"
    return f"{above}.{word}" if is_property else f"{above.rstrip('/')}/{word}"

"""BVH (Biovision hierarchy): a joint tree, then one row of channel values per frame."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.errors import ClipError
from motionlake.formats.clip_checks import MAX_FPS, MIN_FPS, most_of
from motionlake.formats.limits_config import FARTHEST, limits
from motionlake.formats.parse.lines import line_of
from motionlake.formats.parse.numbers import parse_table
from motionlake.motion.clip import POSITION_CHANNELS, ROTATION_CHANNELS, ChannelKind, Hierarchy, SourceClip
from motionlake.motion.rotations import IDENTITY
from motionlake.names import unique

MAX_HEADER_BYTES: Final = 4 * 1024**2  # tokens take twenty times as much
_CHANNELS: Final = {name.lower(): name for name in POSITION_CHANNELS + ROTATION_CHANNELS}
_MOTION: Final = re.compile(rb"^[ \t]*MOTION[ \t\r]*$", re.IGNORECASE | re.MULTILINE)
_FRAMES: Final = re.compile(rb"\s*Frames[ \t]*:[ \t]*(\S+)[ \t\r]*(?:\n|\Z)", re.IGNORECASE)
_FRAME_TIME: Final = re.compile(rb"\s*Frame[ \t]+Time[ \t]*:[ \t]*(\S*)[ \t\r]*(?:\n|\Z)", re.IGNORECASE)
_ROW: Final = re.compile(rb"\S[^\n]*")
_TOKEN: Final = re.compile(r"[{}]|[^\s{}]+")


@dataclass
class _Tokens:
    """The header's tokens with their lines, read one after another."""

    words: list[str]
    lines: list[int]
    next: int = 0

    @classmethod
    def of(cls, text: str) -> _Tokens:
        found = [_TOKEN.findall(line) for line in text.split("\n")]
        return cls(list(chain(*found)), [number for number, words in enumerate(found, start=1) for _ in words])

    @property
    def line(self) -> int:
        """Line of the token last taken."""
        return self.lines[max(self.next - 1, 0)] if self.lines else 1

    def take(self, wanted: str) -> str:
        if self.next >= len(self.words):
            raise ClipError(f"the header ends where {wanted} is expected", self.line)
        self.next += 1
        return self.words[self.next - 1]

    def expect(self, word: str) -> None:
        found = self.take(repr(word))
        if found.upper() != word:
            raise ClipError(f"{found!r} where {word!r} is expected", self.line)

    def name(self) -> str:
        """The words up to the brace or the line's end: names may hold spaces."""
        line = self.line
        words = []
        while self.next < len(self.words) and self.lines[self.next] == line and self.words[self.next] != "{":
            words.append(self.take("a name"))
        return " ".join(words)

    def number(self) -> float:
        word = self.take("a number")
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ClipError(f"{word!r} is not a finite number", self.line)
        if abs(value) > FARTHEST:
            raise ClipError(f"{word!r} is absurdly large", self.line)
        return value

    def vector(self) -> tuple[float, float, float]:
        return self.number(), self.number(), self.number()


@dataclass
class _Tree:
    """The joint tree while it grows."""

    joints: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[tuple[float, float, float] | None] = field(default_factory=list)
    channels: list[tuple[str, ...]] = field(default_factory=list)
    end_sites: list[tuple[int, tuple[float, float, float]]] = field(default_factory=list)

    def add(self, name: str, parent: int) -> int:
        self.joints.append(name)
        self.parents.append(parent)
        self.offsets.append(None)
        self.channels.append(())
        return len(self.joints) - 1


@lru_cache(maxsize=256)
def _channels_named(words: tuple[str, ...]) -> tuple[str, ...]:
    """The channels that words name; none where one names no channel, or one that another has named."""
    names = {_CHANNELS.get(word.lower(), ""): None for word in words}
    return () if "" in names or len(names) < len(words) else tuple(names)


def _read_channels(tokens: _Tokens) -> tuple[str, ...]:
    word = tokens.take("the number of channels")
    if not word.isascii() or not word.isdigit() or len(word) > 3 or int(word) > len(_CHANNELS):
        raise ClipError(f"{word!r} is not a number of channels", tokens.line)
    count = int(word)
    named = _channels_named(tuple(tokens.words[tokens.next : tokens.next + count]))
    if len(named) == count:
        tokens.next += count
        return named
    names = []
    for _ in range(count):
        found = tokens.take("a channel")
        name = _CHANNELS.get(found.lower())
        if name is None:
            raise ClipError(f"CHANNELS {word}, but {found!r} is not a channel", tokens.line)
        if name in names:
            raise ClipError(f"channel {name!r} twice in one joint", tokens.line)
        names.append(name)
    return tuple(names)


def _read_end_site(tokens: _Tokens) -> tuple[float, float, float]:
    tokens.name()
    tokens.expect("{")
    tokens.expect("OFFSET")
    offset = tokens.vector()
    tokens.expect("}")
    return offset


def _read_tree(tokens: _Tokens) -> _Tree:
    tree = _Tree()
    tokens.expect("HIERARCHY")
    tokens.expect("ROOT")
    open_joints = [tree.add(tokens.name(), -1)]
    tokens.expect("{")
    while open_joints:
        joint = open_joints[-1]
        word = tokens.take("'}'")
        match word.upper():
            case "OFFSET" if tree.offsets[joint] is None:
                tree.offsets[joint] = tokens.vector()
            case "CHANNELS" if not tree.channels[joint]:
                tree.channels[joint] = _read_channels(tokens)
            case "JOINT":
                open_joints.append(tree.add(tokens.name(), joint))
                limits().check("joints", len(tree.joints), "has too many joints", tokens.line)
                tokens.expect("{")
            case "END":
                tree.end_sites.append((joint, _read_end_site(tokens)))
            case "}":
                if tree.offsets[joint] is None:
                    raise ClipError(f"joint {tree.joints[joint]!r} has no OFFSET", tokens.line)
                open_joints.pop()
            case _:
                raise ClipError(f"{word!r} is not expected in joint {tree.joints[joint]!r}", tokens.line)
    if tokens.next < len(tokens.words):
        raise ClipError(f"{tokens.take('MOTION')!r} where 'MOTION' is expected", tokens.line)
    return tree


def frame_rate(frame_time: str) -> float:
    """Frames a second of a written frame time: the only whole number that rounds to it, if there is one.

    ".0083333" is 120, not 120.00048; "0.0333667" stays 29.97, "0.016" 62.5.

    Raises:
        ValueError: not a number above 0.
    """
    seconds = float(frame_time)
    if not seconds > 0:
        raise ValueError(frame_time)
    mantissa, _, exponent = frame_time.lower().partition("e")
    decimals = len(mantissa.partition(".")[2]) - int(exponent or 0)
    half_step = max(0.5 * 10.0**-decimals, 4 * math.ulp(seconds))
    slowest = 1 / (seconds + half_step)
    fastest = 1 / (seconds - half_step) if seconds > half_step else math.inf
    whole = math.ceil(slowest)
    return float(whole) if whole <= fastest < whole + 1 else 1 / seconds


def _rate(frame_time: str, line: int) -> float:
    try:
        fps = frame_rate(frame_time)
    except (ValueError, OverflowError):
        raise ClipError(f"{frame_time[:40]!r} is not a frame time above 0: say --fps", line) from None
    if not MIN_FPS <= fps <= MAX_FPS:
        raise ClipError(f"frame time {frame_time[:40]} s is {fps:.4g} frames a second: say --fps", line)
    return fps


def _rows_from(data: bytes, start: int, declared: int) -> int:
    """How many rows follow byte `start`: as many as declared, or those that there are where there are more.

    Programs write one frame more than they say, and players take what is there.
    """
    lines = data.count(b"\n", start) + (not data.endswith(b"\n"))
    return declared if lines <= declared else max(declared, sum(1 for _ in _ROW.finditer(data, start)))


def _decode(header: bytes) -> str:
    try:
        return header.decode("utf-8-sig")
    except UnicodeDecodeError:
        return header.decode("latin-1")


class BvhReader:
    """Reader of .bvh files."""

    name = "BVH"
    suffixes = (".bvh",)

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read a BVH file; `fps` stands in place of its frame time.

        Raises:
            ClipError: with the line, for a header that is no joint tree, a token that is no number, rows that
                do not fit the channels, fewer of them than declared, or a frame time outside 1/1000 to 1 s.
        """
        motion = _MOTION.search(data, 0, MAX_HEADER_BYTES)
        if motion is None:
            raise ClipError("is no BVH file, or cut short: no line MOTION")
        tree = _read_tree(_Tokens.of(_decode(data[: motion.start()])))
        declared = _FRAMES.match(data, motion.end())
        if declared is None:
            raise ClipError("no 'Frames:' after MOTION", line_of(data, motion.end()))
        frames = declared[1].decode("latin-1")
        if not frames.isascii() or not frames.isdigit() or len(frames) > 12:
            raise ClipError(f"{frames[:40]!r} is not a number of frames", line_of(data, declared.start(1)))
        timing = _FRAME_TIME.match(data, declared.end())
        if fps is None:
            if timing is None:
                raise ClipError("no 'Frame Time:' after 'Frames:': say --fps", line_of(data, declared.end()))
            fps = _rate(timing[1].decode("latin-1"), line_of(data, timing.start(1)))
        columns = sum(map(len, tree.channels))
        if not columns:
            raise ClipError("no joint has a channel")
        # A count that the bytes cannot hold is damage, which `parse_table` tells.
        held = min(int(frames), len(data) // (2 * columns) + 1)
        limits().check_body(held, len(tree.joints), len(data), line_of(data, declared.start(1)))
        names = tuple(unique(tree.joints))
        renamed = [new for old, new in zip(tree.joints, names, strict=True) if old != new]
        hierarchy = Hierarchy(
            joints=names,
            parents=tuple(tree.parents),
            offsets=np.array(tree.offsets, float),
            channels=tuple(tree.channels),
            kind=ChannelKind.EULER,
            axes=np.tile(IDENTITY, (len(names), 1)),
            end_sites=tuple(tree.end_sites),
        )
        notes = [f"joint names used twice, renamed: {', '.join(renamed)}"] if renamed else []
        start = (timing or declared).end()
        rows = _rows_from(data, start, int(frames))
        if rows > int(frames):
            limits().check_body(rows, len(tree.joints), len(data), line_of(data, declared.start(1)))
            notes.append(f"{rows} frames, though the file says {int(frames)}")
        table = parse_table(data, start, rows, columns, most_of(hierarchy))
        return [SourceClip(hierarchy, table, fps, notes=tuple(notes))]


READER: Final = BvhReader()

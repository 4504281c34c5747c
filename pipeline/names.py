"""Names are only data: their text in a lake, on a terminal, in a page and as that of a file.

A file's name is bytes. In a lake it is text that gives these bytes back: UTF-8 as it is, and every other byte as
`\\xHH` (`take\\xe9.bvh`); where such a spelling stands in a name itself, its backslash is spelled `\\x5c`.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from html import escape
from itertools import count
from typing import Any, Final

LONGEST: Final = 100  # characters of a file name that is made of a clip's
# What a terminal or a page would obey rather than show: controls, turns of direction, lone surrogates, line ends.
_OBEYED: Final = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
_BYTE: Final = re.compile(rb"\\x([0-9a-f]{2})")
_LIKE_A_BYTE: Final = re.compile(r"\\(?=x[0-9a-f]{2})")
_RESERVED: Final = re.compile(r"^(con|prn|aux|nul|conin\$|conout\$|com[0-9¹²³]|lpt[0-9¹²³])(?=\.|$)", re.IGNORECASE)


def printable(text: str) -> str:
    """Text in which characters that a terminal or a page would obey are spelled out, such as `\\x1b` or `\\u202e`."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(c.encode("unicode_escape").decode() if unicodedata.category(c) in _OBEYED else c for c in text)


def json_text(value: Any) -> str:
    """A value as JSON of many lines, with what a terminal would obey spelled as JSON spells it."""
    text = json.dumps(value, ensure_ascii=False, indent=2, default=str)
    if text.isascii():  # JSON itself spells the controls of ASCII out
        return text.replace("\x7f", "\\u007f")
    return "".join(json.dumps(c)[1:-1] if c != "\n" and unicodedata.category(c) in _OBEYED else c for c in text)


def toml_text(text: str) -> str:
    """A string of TOML, which unlike JSON has no halves of characters, and takes no control as it is."""
    quoted = json.dumps(text, ensure_ascii=False)
    return "".join(f"\\U{ord(c):08x}" if unicodedata.category(c) in _OBEYED else c for c in quoted)


def html(value: object) -> str:
    """A value as text of an HTML element or of a quoted attribute."""
    return escape(printable(str(value)))


def kept(path: str | os.PathLike[str]) -> str:
    """A path as a lake keeps it: text, whatever its bytes."""
    text = os.fspath(path)
    return text if text.isascii() and "\\" not in text else typed(_LIKE_A_BYTE.sub(r"\\x5c", text))


def typed(name: str) -> str:
    """A name as a person gave it, with bytes that are no UTF-8 as a lake keeps them."""
    text = re.sub("[\udc80-\udcff]", lambda byte: f"\\x{ord(byte[0]) - 0xDC00:02x}", name)
    return text.encode(errors="backslashreplace").decode()  # other halves of characters are no file's


def on_disk(text: str) -> str:
    """The path that `kept` was given."""
    return os.fsdecode(_BYTE.sub(lambda byte: bytes.fromhex(byte[1].decode()), os.fsencode(text)))


def file_name(text: str) -> str:
    """A text as the name of a file, or as the beginning of one, that every system takes and no shell or folder obeys.

    Letters of all scripts stay; at most `LONGEST` characters and 200 bytes, the last ones.
    """
    name = "".join("-" if unicodedata.category(c) in _OBEYED or c in '/\\:*?"<>|' else c for c in text)
    return _short(name)


def safe_name(clip: str) -> str:
    """A clip's name as that of a file in any folder of any system: letters, digits and ._- without leading dots."""
    return _short(re.sub(r"[^A-Za-z0-9._-]+", "-", clip))


def _short(name: str) -> str:
    name = name.strip(".- ")[-LONGEST:]
    while len(name.encode(errors="replace")) > 200:
        name = name[1:]
    return _RESERVED.sub(r"\1-", name.lstrip(".- ")) or "clip"


def folded(name: str) -> str:
    """What names have in common that some file systems take for one."""
    return unicodedata.normalize("NFKC", name).casefold().rstrip(". ")


def unique(names: list[str]) -> Iterator[str]:
    """The names, every repetition with a number that makes it another name ("Hand", "Hand.2"); case does not count."""
    taken = {name.casefold() for name in names}
    repeats: dict[str, Iterator[int]] = {}
    for name in names:
        fresh, key = name, name.casefold()
        if key in repeats:
            fresh = next(new for i in repeats[key] if (new := f"{name}.{i}").casefold() not in taken)
            taken.add(fresh.casefold())
        else:
            repeats[key] = count(2)
        yield fresh


def told_apart(clips: Iterable[str], name: Callable[[str], str]) -> dict[str, str]:
    """The names of the files of clips; where several are the same to a file system, with a mark of the clip's own."""
    names = {clip: name(clip) for clip in clips}
    alike = Counter(map(folded, names.values()))
    return {clip: own if alike[folded(own)] == 1 else f"{own}-{_mark(clip)}" for clip, own in names.items()}


def _mark(clip: str) -> str:
    return hashlib.sha256(clip.encode()).hexdigest()[:8]

"""Names and labels that are no names to some program: a folder of small clips that bear them, as a file system may."""

from __future__ import annotations

import csv
import os
import unicodedata
from html.parser import HTMLParser
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.names import kept

from tests.samples import KINECT_1, KINECT_1_PARENTS, kinect_2_from_1, npz_bytes, ntu_text, swinging_body

# Names of clip files without their suffix. Unlike in text, each is a file of its own on a file system of bytes.
STEMS: Final[tuple[bytes, ...]] = (
    # markup, pages, shells, SQL, spreadsheets, globs
    b"take[a]", b"[red]x[", b":smile:", b"<img src=x onerror=alert(1)>", b"a&lt;]]>", b"$(id)`id`", b"%s%n{0}$1_2^3",
    b"x'; DROP TABLE clips; --", b"=cmd|' '!A0", b"-dash", b"--help", b"UserError: star*?", b"[a-z]", b"a,b", b"NULL",
    # marks of bodies, blanks, dots, backslashes
    b"hash#1", b"two.npz#1", b" lead", b"trail ", b"dots..", b"back\\slash", b"x..\\up",
    # what a terminal obeys
    b"esc\x1b[2J\x07", b"new\nline\t\r", "c1\x9b\x7f\U000e0041".encode(), "rtl\u202egpj\u200b\u2028".encode(),
    # bytes that are no UTF-8, and names that spell them
    b"caf\xe9", b"caf\\xe9", b"\xff\\\xfe", b"\\x5cxe9",
    # names that are the same to some file system
    b"A", b"a", "caf\u00e9".encode(), "cafe\u0301".encode(), "\u212a".encode(), b"K", b"CON", b"nul.tar",
    # long ones
    b"n" * 251, "\u00e9".encode() * 125, "日本👍".encode(),
)  # fmt: skip
LABELS: Final = (
    "[/red]", "<script>alert(1)</script>", "\x1b[2J\x07", "a\nb", "'; DROP TABLE clips; --", "=1+1", "rtl\u202e",
    "../../up", "x" * 300, "a+b", "$x$ {0}", "NULL", "no label", "日本👍", "nul\0l",
)  # fmt: skip


def hostile_clips(folder: Path, stems: tuple[bytes, ...] = STEMS, labels: tuple[str, ...] = LABELS) -> None:
    """A clip a stem, files of several bodies, damaged ones, and labels and segments for all of them."""
    folder.mkdir(parents=True)
    rows: list[dict[str, object]] = []
    segments: list[dict[str, object]] = []
    for i, stem in enumerate(stems):
        body = swinging_body(36 + i % 5)
        body[:, 5, 1] += 0.1 * np.sin(np.arange(len(body)) / (3 + i))
        joints = (*KINECT_1, labels[i % len(labels)].replace("\0", ""))
        content = npz_bytes(np.concatenate([body, body[:, :1]], axis=1), joints, (*KINECT_1_PARENTS, 0), 30.0)
        path = os.fsdecode(stem + b".npz")
        (folder / path).write_bytes(content)
        label = labels[i % len(labels)]
        rows.append({"file": kept(path), "label": label, "subject": labels[-1 - i % len(labels)], label or "x": label})
        if i % 3 == 0:
            segments.append({"file": kept(path), "start": 0, "stop": 20, "label": label})
    two = [(str(i), 0, kinect_2_from_1(swinging_body(40 + i))) for i in range(2)]
    for name in (b"two", b"two!x", b"two\x1b\xe9"):
        (folder / os.fsdecode(name + b".skeleton")).write_text(ntu_text(two))
    for name in (b"bad\xe9\x1b[31m", b"bad[red]", b"bad\nline"):
        (folder / os.fsdecode(name + b".npz")).write_bytes(b"none")
    write_rows(folder / "labels.csv", rows)
    write_rows(folder / "segments.csv", segments)


def write_rows(path: Path, rows: list[dict[str, object]]) -> None:
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="", encoding="utf-8") as handle:
        writer = csv.DictWriter(handle, columns)
        writer.writeheader()
        writer.writerows(rows)


def obeyed(text: str) -> set[str]:
    """Characters that a terminal would obey, but for the ends of lines."""
    return {c for c in text if c != "\n" and unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")}


class Tags(HTMLParser):
    """Elements of a page, names of their attributes, and texts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: set[str] = set()
        self.texts: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes |= {name for name, _ in attrs}

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

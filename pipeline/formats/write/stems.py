"""Names of the files of clips."""

from __future__ import annotations

from motionlake.formats.registry import readers
from motionlake.names import file_name


def clip_stem(clip: str) -> str:
    """The name of a clip's file without its suffix, and which body of it is meant."""
    path, mark, body = clip.rpartition("#")
    if not mark or "." in body:  # the mark is of the file's own name
        path, body = clip, ""
    stem = path.rpartition("/")[2].removesuffix(".gz")
    suffixes = (suffix for reader in readers() for suffix in reader.suffixes)
    longest = max((s for s in suffixes if stem.lower().endswith(s)), key=len, default="")
    return file_name(stem[: len(stem) - len(longest)] + (f"-{body}" if body else ""))

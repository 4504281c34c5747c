"""Which ASF file an AMC file moves."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from motionlake.errors import ClipError
from motionlake.formats.registry import COMPRESSED_SUFFIX
from motionlake.formats.remembered import Remembered

_ANCESTORS: Final = 3
_SUFFIXES: Final = (".asf", f".asf{COMPRESSED_SUFFIX}")


def _list_skeletons(folder: Path) -> dict[str, Path]:
    names = sorted(entry.name for entry in folder.iterdir() if entry.name.lower().endswith(_SUFFIXES))
    return {name.lower().removesuffix(COMPRESSED_SUFFIX).removesuffix(".asf"): folder / name for name in names}


_listed: Final = Remembered(_list_skeletons, size=256)


def _skeletons_in(folder: Path) -> dict[str, Path]:
    """The folder's ASF files by lower-case stem."""
    try:
        return _listed(folder)
    except OSError:
        return {}


def _prefixes(stem: str, skeletons: dict[str, Path]) -> Iterator[str]:
    """Stems of skeletons that `stem` begins with, up to a character that is no letter or digit."""
    for prefix in skeletons:
        if prefix and stem.startswith(prefix) and not stem[len(prefix) : len(prefix) + 1].isalnum():
            yield prefix


def find_skeleton(path: Path, named: str = "") -> tuple[Path, str]:
    """The ASF file that an AMC file moves, and why it is that one.

    In this order: the name that the AMC gives (`#!OML:ASF`), in its folder; the AMC's own stem; the longest
    stem that the AMC's name begins with ("HDM_bd.asf" for "HDM_bd_walk_001.amc"), in the folder or the
    nearest of 3 above it that has one; the only ASF of the folder.

    Raises:
        ClipError: none of these; says where it looked.
    """
    stem = path.name.lower().removesuffix(COMPRESSED_SUFFIX).removesuffix(".amc")
    folder = path.absolute().parent
    here = _skeletons_in(folder)
    by_name = named.lower().removesuffix(".asf")
    if by_name in here:
        return here[by_name], "named by the clip"
    ancestor, skeletons = folder, here
    for _ in range(1 + _ANCESTORS):
        found = max(_prefixes(stem, skeletons), key=len, default=None)
        if found is not None:
            return skeletons[found], "the clip's name begins with its name"
        if ancestor == ancestor.parent:
            break
        ancestor = ancestor.parent
        skeletons = _skeletons_in(ancestor)
    if len(here) == 1:
        return next(iter(here.values())), "the only one in the clip's folder"
    wanted = f"{named!r} or " if named else ""
    raise ClipError(
        f"no skeleton: {wanted}an .asf whose name the clip's begins with, in its folder or the "
        f"{_ANCESTORS} above, or one .asf alone in its folder (it has {len(here)})"
    )

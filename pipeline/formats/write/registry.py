"""Which writer makes which file: every module of this package with a `WRITER` is one format that clips leave in.

A `Writer` makes one file of a clip, a `SetWriter` one folder of many. Either may also have `fps`: the frames a second
that its format has, to which clips are resampled unless the user says another rate.
"""

from __future__ import annotations

import functools
import importlib
import pkgutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Protocol, runtime_checkable

from motionlake.errors import ClipError
from motionlake.motion.clip import SourceClip


@dataclass(frozen=True)
class ClipToWrite:
    """A motion on its way out of a lake.

    Attributes:
        name: of the clip in the lake.
        clip: joint tree and channels in the rig that the file is to have.
        metres_per_unit: length unit of `clip`.
        up: its up axis, x y z -x -y -z.
        facts: what is known of it beside the motion: label, licence, source file, range.
    """

    name: str
    clip: SourceClip
    metres_per_unit: float
    up: str = "y"
    facts: Mapping[str, object] = field(default_factory=dict)


@runtime_checkable
class Writer(Protocol):
    """One format of one file a clip.

    Attributes:
        name: as users say it (`--format`).
        suffix: of its files, with the dot.
        rig: the rig that its files always have (a clip is retargeted to it first); "" where any rig will do.
    """

    name: str
    suffix: str
    rig: str

    def write(self, motion: ClipToWrite, path: Path) -> None:
        """Write the file, whole or not at all; `ClipError` where the format cannot hold the motion."""
        ...


@runtime_checkable
class SetWriter(Protocol):
    """One format that holds a set of clips in the files of one folder.

    Attributes:
        name: as users say it (`--format`).
        rig: as of a `Writer`.
    """

    name: str
    rig: str

    def write_all(self, motions: Iterable[ClipToWrite], folder: Path) -> list[tuple[int, ClipError]]:
        """Write the set into a folder that is there and empty; clips come once, one by one.

        Which clips it left out, as numbers from 0 in the order in which they came, and why. `ClipError` where none
        could be written.
        """
        ...


@functools.cache
def writers() -> dict[str, Writer]:
    """The writers of one file a clip, by name."""
    return {name: writer for name, writer in _found().items() if isinstance(writer, Writer)}


@functools.cache
def set_writers() -> dict[str, SetWriter]:
    """The writers of sets of clips, by name."""
    return {name: writer for name, writer in _found().items() if isinstance(writer, SetWriter)}


def _found() -> dict[str, Writer | SetWriter]:
    """The `WRITER` of every module of this package, by name."""
    found = {}
    for module_info in pkgutil.iter_modules([str(Path(__file__).parent)]):
        module: ModuleType = importlib.import_module(f"{__package__}.{module_info.name}")
        writer = getattr(module, "WRITER", None)
        if isinstance(writer, Writer | SetWriter):
            found[writer.name] = writer
    return dict(sorted(found.items()))

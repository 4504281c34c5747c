"""USD: the skeletons of a stage, moved by their animations. All but plain binary layers need usd-core, an option."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from motionlake.formats.parse.usd_nodes import read_nodes
from motionlake.motion.clip import SourceClip


class UsdReader:
    """USD stages, as text, binary or package: a clip for every skeleton that is animated."""

    name = "USD"
    suffixes = (".usd", ".usda", ".usdc", ".usdz")

    def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
        """Read every skeleton along the stage's time line, sampled at the rate of the keys, which a note says.

        Raises:
            ClipError: usd-core is needed and not installed, cannot read the file, or finds no animated skeleton; a file
                that is made of other files.
        """
        return read_nodes(data).clips(fps)


READER: Final = UsdReader()

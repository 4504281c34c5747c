"""Writing a clip as CSV: a row a frame, with the time and where every joint is."""

from __future__ import annotations

import codecs
import csv
import json
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.formats.parse.table_map import SIDECAR
from motionlake.formats.write.joints import joint_places
from motionlake.formats.write.registry import ClipToWrite
from motionlake.formats.write.whole import whole_file

_DECIMALS: Final = 6  # a micrometre


class CsvWriter:
    """Columns `time` (seconds) and `JOINT.x`, `JOINT.y`, `JOINT.z` (metres, y up); the tree in a file beside it."""

    name = "csv"
    suffix = ".csv"
    rig = ""

    def write(self, motion: ClipToWrite, path: Path) -> None:
        """Write the file, and `NAME.joints.json` with the names, parents and frame rate, each whole or not at all."""
        hierarchy, places = motion.clip.hierarchy, joint_places(motion)
        tree = {"joints": hierarchy.joints, "parents": hierarchy.parents, "fps": motion.clip.fps}
        tree |= {"unit": "metre", "up": "y"}
        with whole_file(path.with_suffix(SIDECAR)) as stream:
            stream.write(json.dumps(tree, ensure_ascii=False, indent=2).encode())
        times = np.arange(len(places)) / motion.clip.fps
        rows = np.round(np.column_stack([times, places.reshape(len(places), -1)]), _DECIMALS) + 0.0  # no -0.0
        with whole_file(path) as stream:
            writer = csv.writer(codecs.getwriter("utf-8")(stream), lineterminator="\n")
            writer.writerow(["time", *(f"{joint}.{axis}" for joint in hierarchy.joints for axis in "xyz")])
            writer.writerows(rows.tolist())


WRITER: Final = CsvWriter()

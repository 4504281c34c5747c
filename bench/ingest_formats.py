"""Reading files in the formats that people exchange: `python -m bench.ingest_formats`.

Pieces of a take of CMU, of 2.5, 10 and 38 seconds, are written in each format and read to clips, against the libraries
that people read the same numbers with (`bench.format_peers`). Those stop at the numbers of every joint in arrays. Here
they are checked as well and made a clip: its tree, unit, up axis and rate, joints found by their names, gaps filled,
rotations turned to quaternions and, of scenes, counted from the rest pose. Three are brought to one point:

- GLB, USD: both sides chain joints, to where they are in the scene;
- TRC: both make joints of points;
- HumanML3D's features: both stop at where joints are.

Rows without a bar have HumanML3D's files read to rotations: against reading joints alone, and against its program's
inverse kinematics written anew, which takes the smallest turn of each bone. Here pelvis and chest turn as a whole; of
features limbs turn about their bones as elbows and knees bend, and joints are placed again and compared.

FBX is read here in a process of its own, by the same library. One process, one thread but for what pandas
starts, calls interleaved, medians; files lie in the system's cache, and compiled code is warm.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

# Before numpy: its libraries read these once.
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

from motionlake.formats import read_clips
from motionlake.formats.humanml3d import read_numbers
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.humanml3d import are_turns, recovered_joints
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs

from bench import format_peers
from bench.format_files import WRITE, Piece
from bench.ingest import compare, read_all
from bench.record import hash_files, installed, record, recordings

LENGTHS: Final = (300, 1200, 4579)  # frames at 120 a second
BAR: Final = 1.0
PEERS: Final = ("pandas", "pygltflib", "scipy", "ufbx", "usd-core")
_MODULES: Final = {"usd-core": "pxr"}


@dataclass(frozen=True)
class Row:
    """A format against a library.

    Attributes:
        file: by which its writer is known in `WRITE`.
        theirs: reads it by other libraries.
        peer: the one that may be lacking.
        ours: reads it by motionlake, all of it where this is None.
        bar: the least ratio.
    """

    file: str
    theirs: Callable[[Path], object]
    peer: str
    ours: Callable[[Path], object] | None = None
    bar: float | None = BAR


def to_joints(path: Path) -> object:
    """Where joints are by HumanML3D's features, checked as they are read."""
    rows = read_numbers(path.read_bytes())
    assert are_turns(rows)
    return recovered_joints(rows)[0]


def to_canonical(path: Path) -> object:
    """Rotations of a clip's joints, whose file has places alone."""
    [clip] = read_clips(path)
    return canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs())).rotations


ROWS: Final = {
    "amass, numpy and scipy": Row("take.amass.npz", format_peers.amass, "scipy"),
    "glb, pygltflib and scipy": Row("take.glb", format_peers.glb, "pygltflib"),
    "fbx, ufbx": Row("take.fbx", format_peers.fbx, "ufbx"),
    "usd, usd-core": Row("take.usdc", format_peers.usd, "usd-core"),
    "csv, pandas": Row("take.csv", format_peers.csv, "pandas"),
    "parquet, pandas": Row("take.parquet", format_peers.parquet, "pandas"),
    "trc, pandas": Row("take.trc", format_peers.trc, "pandas"),
    "motive csv, pandas": Row("take.motive.csv", format_peers.motive, "pandas"),
    "mot, pandas": Row("take.mot", format_peers.mot, "pandas"),
    "humanml3d joints, numpy": Row("joints.npy", format_peers.joints, "scipy"),
    "humanml3d joints to rotations, numpy and scipy": Row(
        "joints.npy", format_peers.joints_turned, "scipy", to_canonical, None
    ),
    "humanml3d features, numpy": Row("features.npy", format_peers.features, "scipy", to_joints),
    "humanml3d features to rotations, numpy and scipy": Row(
        "features.npy", format_peers.features_turned, "scipy", None, None
    ),
    "humanml3d features to rotations, numpy": Row("features.npy", format_peers.features, "scipy", None, None),
}


def formats(take: Path, rounds: int) -> dict[str, dict[str, Any]]:
    """Every comparison, by name and frames."""
    modules = {_MODULES.get(peer, peer): peer for peer in PEERS}
    there = [modules[module] for module in installed(modules)]
    [clip] = read_clips(take)
    figures: dict[str, dict[str, Any]] = {}
    for frames in LENGTHS:
        piece = Piece.of(clip, frames)
        for name, row in ROWS.items():
            if row.peer not in there:
                continue
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder, row.file)
                WRITE[row.file](piece, path)
                ours = partial(row.ours, path) if row.ours else partial(read_all, [path])
                figure = compare(ours, partial(row.theirs, path), row.bar or 0.0, rounds, frames=frames)
                figures[f"{name}, {frames} frames"] = figure
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=15)
    given = parser.parse_args()
    take = recordings() / "cmu_86" / "clips" / "86_01.amc"
    figures = formats(take, given.rounds)
    for name, figure in figures.items():
        print(f"{name}: {', '.join(f'{key} {value:.4g}' for key, value in figure.items())}")
    print(record("ingest-formats", figures, hash_files([take], recordings()), PEERS))


if __name__ == "__main__":
    main()

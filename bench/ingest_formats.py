"""Reading a long take in formats that people exchange: `python -m bench.ingest_formats`.

A take of CMU is written in each format and read to a clip, against the libraries that people read the same numbers
with. Those stop there, but for GLB, whose numbers are also chained from joint to joint, as a clip needs it. One
process, one thread, calls interleaved, medians.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

# Before numpy: its libraries read these once.
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

import numpy as np
from motionlake.formats import read_clips
from motionlake.formats.write.joints import joint_places
from motionlake.formats.write.registry import ClipToWrite, Writer, writers
from motionlake.motion.canonicalise import canonicalise, to_source_clip
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs
from motionlake.motion.skeleton import INDEX
from motionlake.motion.smpl import BODY_JOINTS, JOINTS, smpl_clip

from bench.ingest import compare, read_all
from bench.record import hash_files, installed, record, recordings

PEERS: Final = ("pandas", "pygltflib", "scipy")
BAR: Final = 1.0
# Rotations of the canonical skeleton that stand in for SMPL's; other joints do not turn.
STANDS_FOR: Final = {
    "pelvis": "hips", **{f"{side}_{joint}": f"{side}_{joint}" for side in ("left", "right")
                         for joint in ("hip", "knee", "shoulder", "elbow")},
}  # fmt: skip


def takes(path: Path) -> dict[str, ClipToWrite]:
    """One take on the canonical skeleton, and its main rotations on SMPL's."""
    clip = read_clips(path)[0]
    solved = solve(clip)
    motion = canonicalise(clip, solved, identify(clip.hierarchy.joints, load_rigs()))
    rotations = np.zeros((len(motion), BODY_JOINTS, 4))
    rotations[..., 0] = 1.0
    for joint, name in STANDS_FOR.items():
        rotations[:, JOINTS.index(joint)] = motion.rotations[:, INDEX[name]]
    body = smpl_clip(motion.positions[:, 0], rotations, motion.fps)
    return {
        "canonical": ClipToWrite("take", to_source_clip(motion), 1.0, "y"),
        "smpl": ClipToWrite("take", body, 1.0, "y"),
    }


def amass_read(path: Path) -> object:
    """Quaternions of an AMASS archive by NumPy and SciPy."""
    from scipy.spatial.transform import Rotation

    with np.load(path) as archive:
        return Rotation.from_rotvec(archive["poses"].reshape(-1, 3)).as_quat(), archive["trans"]


def gltf_read(path: Path) -> object:
    """Where the animated joints of a GLB are, as matrices: its numbers by pygltflib, turned by SciPy."""
    import pygltflib
    from scipy.spatial.transform import Rotation

    gltf = pygltflib.GLTF2().load(str(path))
    blob, widths = gltf.binary_blob(), {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
    animation, moved = gltf.animations[0], {}
    for channel in animation.channels:
        accessor = gltf.accessors[animation.samplers[channel.sampler].output]
        start = gltf.bufferViews[accessor.bufferView].byteOffset + (accessor.byteOffset or 0)
        width = widths[accessor.type]
        values = np.frombuffer(blob, "<f4", accessor.count * width, start).reshape(-1, width)
        moved[channel.target.node, channel.target.path] = values
    worlds: dict[int, np.ndarray[Any, Any]] = {}
    waiting: list[tuple[int, int | None]] = [(gltf.skins[0].skeleton, None)]
    while waiting:
        node, parent = waiting.pop()
        rotations = moved[node, "rotation"]
        local = np.tile(np.eye(4), (len(rotations), 1, 1))
        local[:, :3, :3] = Rotation.from_quat(rotations).as_matrix()
        local[:, :3, 3] = moved.get((node, "translation"), gltf.nodes[node].translation)
        worlds[node] = local if parent is None else worlds[parent] @ local
        waiting += [(child, node) for child in gltf.nodes[node].children or []]
    return worlds


def csv_read(path: Path) -> object:
    """The numbers of a table as text, by pandas."""
    import pandas

    return pandas.read_csv(path).to_numpy()


def parquet_read(path: Path) -> object:
    """The numbers of a Parquet table, by pandas."""
    import pandas

    return pandas.read_parquet(path).to_numpy()


def write_parquet(motion: ClipToWrite, path: Path) -> None:
    """Places of joints, a column each, with the time."""
    import pyarrow as pa
    from pyarrow import parquet

    places = joint_places(motion)
    columns = {"time": np.arange(len(places)) / motion.clip.fps}
    for joint, name in enumerate(motion.clip.hierarchy.joints):
        columns |= {f"{name}.{axis}": places[:, joint, at] for at, axis in enumerate("xyz")}
    parquet.write_table(pa.table(columns), path)


def formats(take: Path, rounds: int) -> dict[str, dict[str, Any]]:
    """Every comparison, by name."""
    motions, there = takes(take), installed(PEERS)
    rows: dict[str, tuple[str, str, str, Callable[[Path], object]]] = {
        "amass, numpy and scipy": ("scipy", "smpl", "amass.npz", amass_read),
        "glb, pygltflib": ("pygltflib", "canonical", "take.glb", gltf_read),
        "csv, pandas": ("pandas", "canonical", "take.csv", csv_read),
        "parquet, pandas": ("pandas", "canonical", "take.parquet", parquet_read),
    }
    figures: dict[str, dict[str, Any]] = {}
    for name, (peer, rig, file, theirs) in rows.items():
        if peer not in there:
            continue
        with tempfile.TemporaryDirectory() as folder:
            path, motion = Path(folder, file), motions[rig]
            writer = writers().get(name.partition(",")[0])
            if isinstance(writer, Writer):
                writer.write(motion, path)
            else:
                write_parquet(motion, path)
            work = len(motion.clip.channels)
            figures[name] = compare(partial(read_all, [path]), partial(theirs, path), BAR, rounds, frames=work)
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7)
    given = parser.parse_args()
    take = recordings() / "cmu_86" / "clips" / "86_01.amc"
    figures = formats(take, given.rounds)
    for name, figure in figures.items():
        print(f"{name}: {', '.join(f'{key} {value:.4g}' for key, value in figure.items())}")
    print(record("ingest-formats", figures, hash_files([take], recordings()), PEERS))


if __name__ == "__main__":
    main()

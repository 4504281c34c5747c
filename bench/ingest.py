"""Reading clips against the best public readers: `python -m bench.ingest peers`.

One process, one thread, calls interleaved, medians, compiled code warm. Needs MOTIONLAKE_DATA and the peers
(`pip install motionlake[bench]`).
"""

from __future__ import annotations

import argparse
import os
import tempfile
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

# Before numpy: its libraries read these once.
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}

from motionlake.formats import read_clips
from motionlake.formats.write.points_c3d import C3dWriter
from motionlake.formats.write.registry import ClipToWrite
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs

from bench.record import hash_files, installed, interleave, record, recordings

PEERS = ("pybvh", "bvhio", "asfamc-parser", "ezc3d", "c3d")
# Lowest acceptable ratios, measured on other machines with 30 % slack.
BARS = {"bvh parse": 2.5, "bvh solve": 6.0, "bvhio solve": 100.0, "amc parse": 15.0}
BARS |= {"c3d, ezc3d": 2.0, "c3d, package c3d": 2.0}


def read_all(paths: list[Path]) -> None:
    """Read clips."""
    for path in paths:
        read_clips(path)


def solve_all(paths: list[Path]) -> int:
    """Read and solve clips; their frames."""
    return sum(len(solve(clip).positions) for path in paths for clip in read_clips(path))


def pybvh_read(paths: list[Path]) -> list[Any]:
    """Read clips with pybvh, its search for the up axis off."""
    import pybvh

    return [pybvh.read_bvh_file(path, world_up="+y", warn_on_world_up_disagreement=False) for path in paths]


def pybvh_solve(paths: list[Path]) -> None:
    """Local quaternions and global positions with pybvh."""
    for clip in pybvh_read(paths):
        clip.to_quat()
        clip.node_positions()


def bvhio_solve(path: Path) -> None:
    """Rotations and global positions of every joint and frame with bvhio."""
    import bvhio

    root = bvhio.readAsHierarchy(str(path))
    joints = [joint for joint, _, _ in root.layout()]
    first, last = root.getKeyframeRange()
    for frame in range(first, last + 1):
        root.loadPose(frame)
        for joint in joints:
            _ = joint.Rotation, joint.PositionWorld


def asfamc_read(paths: list[Path]) -> None:
    """Read AMC files with asfamc-parser."""
    from asfamcparser import ParseAMC

    for path in paths:
        ParseAMC(str(path))


def without_first_line(paths: list[Path], folder: Path) -> list[Path]:
    """Copies without the `#!OML` line, on which asfamc-parser fails."""
    copies = []
    for path in paths:
        copy = folder / path.name
        copy.write_bytes(path.read_bytes().partition(b"\n")[2])
        copies.append(copy)
    return copies


def size_of(paths: list[Path]) -> float:
    """Megabytes."""
    return sum(path.stat().st_size for path in paths) / 1e6


def compare(
    ours: Callable[[], object], theirs: Callable[[], object], bar: float, rounds: int, **work: float
) -> dict[str, Any]:
    """Time two functions; seconds, units of work a second, their ratio and the bar."""
    seconds = interleave({"ours": ours, "theirs": theirs}, rounds)
    rates = {
        f"{who}_{unit}_per_second": round(amount / seconds[who], 1) for unit, amount in work.items() for who in seconds
    }
    return {**seconds, **rates, "ratio": round(seconds["theirs"] / seconds["ours"], 2), "bar": bar}


def marker_figures(take: Path, rounds: int) -> dict[str, dict[str, Any]]:
    """Files of points made of a take: reading them to joints, against libraries that read the numbers."""
    figures: dict[str, dict[str, Any]] = {}
    there = installed(("ezc3d", "c3d"))
    clip = read_clips(take)[0]
    solved = solve(clip)
    motion = canonicalise(clip, solved, identify(clip.hierarchy.joints, load_rigs()))
    with tempfile.TemporaryDirectory() as folder:
        points = Path(folder, "take.c3d")
        ours = partial(read_all, [points])
        if "ezc3d" in there:
            import ezc3d

            C3dWriter().write(ClipToWrite("take", clip, motion.metres_per_unit, motion.up), points)
            figures["c3d, ezc3d"] = compare(
                ours,
                lambda: ezc3d.c3d(str(points))["data"]["points"].shape,
                BARS["c3d, ezc3d"],
                rounds,
                frames=len(motion),
            )
        if {"ezc3d", "c3d"} <= set(there):
            figures["c3d, package c3d"] = compare(
                ours, partial(c3d_read, points), BARS["c3d, package c3d"], min(rounds, 3), frames=len(motion)
            )
    return figures


def c3d_read(path: Path) -> int:
    """The frames of a C3D, read by the package c3d."""
    import c3d

    with path.open("rb") as stream:
        return sum(1 for _ in c3d.Reader(stream).read_frames(copy=False))


def peers(rounds: int) -> dict[str, dict[str, Any]]:
    """Every comparison, by name."""
    data = recordings()
    dance = sorted((data / "cmu_dance").rglob("*.bvh"))[:12]
    bandai = sorted((data / "bandai1").rglob("*.bvh"))[:81]
    long_take = data / "cmu_86" / "clips" / "86_01.amc"
    amc = [long_take, *sorted((data / "hdm05" / "clips").rglob("*.amc"))[::24]]
    small = [min(dance, key=lambda path: path.stat().st_size)]
    frames = solve_all(dance)
    figures: dict[str, dict[str, Any]] = {}
    there = installed(("pybvh", "bvhio", "asfamcparser"))
    if "pybvh" in there:
        figures["bvh parse"] = compare(
            partial(read_all, dance),
            lambda: pybvh_read(dance),
            BARS["bvh parse"],
            rounds,
            megabytes=size_of(dance),
            frames=frames,
        )
        figures["bvh solve"] = compare(
            lambda: solve_all(dance), lambda: pybvh_solve(dance), BARS["bvh solve"], rounds, frames=frames
        )
    if "bvhio" in there:
        figures["bvhio solve"] = compare(
            lambda: solve_all(small),
            lambda: bvhio_solve(small[0]),
            BARS["bvhio solve"],
            min(rounds, 3),
            frames=solve_all(small),
        )
    with tempfile.TemporaryDirectory() as folder:
        copies = without_first_line(amc, Path(folder))
        for name, part in (("amc parse", slice(None)), ("amc parse, short clips", slice(1, None))):
            if "asfamcparser" in there:
                figures[name] = compare(
                    partial(read_all, amc[part]),
                    partial(asfamc_read, copies[part]),
                    BARS["amc parse"],
                    min(rounds, 5),
                    megabytes=size_of(amc[part]),
                )
    figures |= marker_figures(long_take, rounds)
    # pybvh refuses these: they have position channels below the root.
    seconds = interleave({"parse": partial(read_all, bandai), "solve": lambda: solve_all(bandai)}, rounds)
    figures["bandai, ours alone"] = {
        "parse_megabytes_per_second": round(size_of(bandai) / seconds["parse"], 1),
        "solve_frames_per_second": round(solve_all(bandai) / seconds["solve"], 1),
    }
    used = [*dance, *bandai, *amc, *small]
    print(f"written to {record('ingest-peers', figures, hash_files(used, data), PEERS)}")
    return figures


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Measure reading clips against public readers.")
    parser.add_argument("what", choices=["peers"])
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    for name, figure in peers(arguments.rounds).items():
        print(f"{name}: {', '.join(f'{key} {value:.4g}' for key, value in figure.items())}")


if __name__ == "__main__":
    main()

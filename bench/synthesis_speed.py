"""How fast motion is made: `python -m bench.synthesis_speed [--counts N ...] [--workers N]`.

In the lake: a generator of utd_mhad (split train) makes N clips of 8 s each by `motionlake synthesize`, interpreter,
cluster, Parquet and catalog included; seconds of motion for a second of work, peak memory of all processes together.

The networks alone, one thread, in one process, interleaved: 32 motions of 8 s by the generator (sparse poses, dense
frames, rotations on the body), and as many frames by an acLSTM of the size that its paper has (three layers of 1024),
which puts out joints and nothing else. Its weights are random: what they are does not change its time.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.glogen.generator import TrainedGenerator, load_generator
from motionlake.glogen.sparse import HEIGHT
from motionlake.glogen.trajectories import FPS
from motionlake.lake.catalog import create_catalog
from motionlake.lake.layout import Lake
from motionlake.motion.generation import MotionRequest, SeedClip
from motionlake.training import on_threads

from bench.canonical_sets import LabelledClip
from bench.glogen.baseline import Settings, Shape
from bench.glogen.material import BONES
from bench.glogen.next_pose import AutoConditioned
from bench.glogen.sets import split_of
from bench.memory import watch
from bench.record import hash_files, interleave, record, recordings

CHECKOUT: Final = Path(__file__).parents[1]
SET: Final = "utd_mhad"
COUNTS: Final = (1, 100, 1000)
SECONDS: Final = 8.0
TOGETHER: Final = 32
PAST: Final = 25  # frames that acLSTM is given
UNITS: Final = 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--counts", nargs="+", type=int, default=COUNTS)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--epochs", type=int, default=0, help="of the generator's training; 0: as the recipe has it")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="bench-synthesis-") as folder:
        lake = Path(folder) / "lake"
        _prepare(lake, given.workers, given.epochs)
        made = {str(count): _made(lake, count, given.workers) for count in given.counts}
        generator = load_generator(next(lake.rglob("synthesis*.safetensors")))
        networks = _networks(generator)
    files = [path for path in (recordings() / SET).rglob("*") if path.is_file()]
    print(f"wrote {record('synthesis-speed', {'lake': made, 'networks': networks}, hash_files(files, recordings()))}")


def _command(*words: str) -> list[str]:
    return [sys.executable, "-m", "motionlake.cli.main", *words]


def _prepare(lake: Path, workers: int, epochs: int) -> None:
    create_catalog(Lake(lake))
    Lake(lake).config_file.write_text(f'[synthesis]\nrecipe = "networks"\nepochs = {epochs}\n', encoding="utf-8")
    for words in (
        ["ingest", str(recordings() / SET), "--dataset", SET, "--workers", str(workers)],
        ["train", "synthesis", "--split", "train"],
    ):
        if watch(_command(*words, "--lake", str(lake)), CHECKOUT).status:
            sys.exit(f"motionlake {' '.join(words)} failed")


def _made(lake: Path, count: int, workers: int) -> dict[str, Any]:
    words = ["synthesize", "--class", "walk", "--class", "boxing", "--seconds", str(SECONDS), "--count", str(count)]
    used = watch(
        _command(*words, "--dataset", f"made{count}", "--workers", str(workers), "--lake", str(lake)), CHECKOUT
    )
    if used.status:
        sys.exit(f"motionlake {' '.join(words)} failed")
    rate = count * SECONDS / used.seconds
    print(
        f"{count:5d} clips: {used.seconds:6.1f} s, {rate:6.1f} s of motion a second, "
        f"{used.together / 2**30:.2f} GiB together, workers {', '.join(f'{w / 2**30:.2f}' for w in used.workers)} GiB",
        flush=True,
    )
    return {**asdict(used), "motion_seconds_a_second": rate}


def _networks(generator: TrainedGenerator) -> dict[str, Any]:
    seconds = interleave({"motionlake": _ours(generator), "acLSTM": _ac_lstm(len(generator.classes))}, rounds=5)
    rates = {name: TOGETHER * SECONDS / value for name, value in seconds.items()}
    ratio = seconds["acLSTM"] / seconds["motionlake"]
    told = ", ".join(f"{name} {rate:.1f}" for name, rate in rates.items())
    print(f"networks: {told} s of motion a second; {ratio:.2f}x")
    return {"seconds": seconds, "motion_seconds_a_second": rates, "ratio": ratio}


def _ours(generator: TrainedGenerator) -> Callable[[], object]:
    clips = [clip for clip in split_of(SET, "test") if clip.label == "walk"][:TOGETHER]
    wishes = [MotionRequest(("walk", "boxing"), SECONDS, i, _seed(clips[i % len(clips)])) for i in range(TOGETHER)]
    return lambda: generator.generate(wishes)


def _seed(clip: LabelledClip) -> SeedClip:
    assert clip.rest_offsets is not None
    return SeedClip(clip.name, clip.positions, clip.fps, clip.rest_offsets)


def _ac_lstm(classes: int) -> Callable[[], object]:
    frames = round(SECONDS * FPS)
    shape = Shape(HEIGHT, classes, PAST, frames, Settings(hidden=UNITS), BONES, torch.zeros(HEIGHT))
    network = AutoConditioned(shape).eval()
    rng = np.random.default_rng(0)
    past = torch.from_numpy(rng.standard_normal((TOGETHER, PAST, HEIGHT)).astype(np.float32))
    prior = torch.eye(classes)[rng.integers(0, classes, TOGETHER)]

    def made() -> object:
        with on_threads(1), torch.inference_mode():
            return network.extend(past, prior, None)

    return made


if __name__ == "__main__":
    main()

"""Train the generator of motion that comes with the package: `python -m bench.pretrained_generator [--out FILE]`.

Only sets whose terms allow derived weights are used: CMU's.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from motionlake.formats import read_clips
from motionlake.glogen.config import PRETRAINED_GENERATOR, SynthesisConfig
from motionlake.glogen.generator import TrainedGenerator, TrainingMotion
from motionlake.glogen.generator_training import train_generator
from motionlake.motion.canonicalise import CanonicalMotion, canonicalise
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs

from bench.pretrained_words import SOURCE
from bench.record import hash_files, recordings, revision

LICENCE: Final = "CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu"
# Examples of how recorded motion goes on, fewer than a lake's own generator keeps: they are most of the file.
EXAMPLES: Final = 2000
# Of cmu_bvh, by exact description: a clip that tells of something else beside it ("run, leap") is of no class. Ballet
# clips are told by their steps; what they have in common is the first word.
DESCRIBED: Final[Mapping[str, Collection[str]]] = {
    "walk": {"walk", "brisk walk", "slow walk", "walk/stride", "slow walk/stride", "walk, exaggerated stride"},
    "run": {"run/jog"},
}
BALLET: Final = "dance - "


def classes() -> dict[Path, str]:
    """The class of every clip of cmu_bvh that has one, and of cmu_dance."""
    found = {}
    for path, row in _rows("cmu_bvh"):
        said = row["description"]
        ballet = "ballet" if said.startswith(BALLET) else None
        label = next((name for name, exact in DESCRIBED.items() if said in exact), ballet)
        if label is not None:
            found[path] = label
    return found | {path: row["label"] for path, row in _rows("cmu_dance")}


def _rows(name: str) -> list[tuple[Path, dict[str, str]]]:
    folder = recordings() / name
    with (folder / "labels.csv").open(newline="", encoding="utf-8") as handle:
        return [(folder / row["file"], row) for row in csv.DictReader(handle)]


def train(labels: Mapping[Path, str], seed: int, epochs: int = 0, checkpoint: Path | None = None) -> TrainedGenerator:
    """The networks of clips of known class; 0 epochs are the recipe's."""
    rigs = load_rigs()
    read: dict[Path, CanonicalMotion] = {}
    for path in sorted(labels):
        clip = read_clips(path)[0]
        read[path] = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, rigs))
    motions = [TrainingMotion(one.positions.astype(float), one.fps, labels[path]) for path, one in read.items()]
    config = SynthesisConfig(recipe="networks", seed=seed, epochs=epochs)
    made = train_generator(motions, config, examples=EXAMPLES, checkpoint=checkpoint, progress=_tell)
    metrics = {
        "clips": len(motions),
        "class_names": made.classes,
        "sets": sorted({path.relative_to(recordings()).parts[0] for path in read}),
        "licences": [LICENCE],
        "filled": sorted({joint for motion in read.values() for joint in motion.filled}),
        "data_sha256": hash_files(sorted(read), recordings()),
        "seconds": round(sum(len(motion.positions) / motion.fps for motion in motions), 1),
        "revision": revision(),
        "source": SOURCE,
    }
    return replace(made, metrics=metrics | {"datasets": metrics["sets"]})


def _tell(done: int, steps: int, loss: float) -> None:
    print(f"{done} of {steps}, loss {loss:.4f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="Train the generator of motion that comes with the package.")
    parser.add_argument("--out", type=Path, default=PRETRAINED_GENERATOR.file)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--epochs", type=int, default=0, help="0: as the recipe has it")
    parser.add_argument("--checkpoint", type=Path, help="a file that keeps training, to go on from")
    given = parser.parse_args()
    made = train(classes(), given.seed, given.epochs, given.checkpoint)
    for network in (made.glogen, made.locgen, made.onset):
        network.half()  # half the file; they are read as single precision again
    given.out.parent.mkdir(parents=True, exist_ok=True)
    made.save(given.out)
    beside = {**made.metrics, "recipe": made.config.recipe}
    given.out.with_suffix(".json").write_text(json.dumps(beside, indent=2) + "\n", encoding="utf-8")
    print(f"{given.out}: {given.out.stat().st_size} bytes, {made.metrics['clips']} motions")


if __name__ == "__main__":
    main()

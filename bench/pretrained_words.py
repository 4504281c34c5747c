"""Train the word network that comes with the package: `python -m bench.pretrained_words [--without SET] [--out FILE]`.

Only sets whose terms allow derived weights are used: CMU's. `--without` leaves one out, to measure on it.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Final

from motionlake.arrays import Float32Array
from motionlake.deep_motifs.config import PRETRAINED_WORDS, NetworkConfig
from motionlake.deep_motifs.words.network import TrainedNetwork
from motionlake.deep_motifs.words.training import Recipe, train_words
from motionlake.formats import is_clip, read_clips
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.features import WordConfig, word_features
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs

from bench.record import hash_files, recordings, revision

SETS: Final = ("cmu_dance", "cmu_bvh", "cmu_exercises", "cmu_86")
SOURCE: Final = (
    "The data used in this project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217."
)


def clips_of(sets: tuple[str, ...]) -> list[Path]:
    """Every clip file of some sets, by path."""
    folders = [recordings() / name / "clips" for name in sets]
    return [path for folder in folders for path in sorted(folder.rglob("*")) if path.is_file() and is_clip(path)]


def features_of(paths: list[Path], config: WordConfig) -> list[Float32Array]:
    """Word features of the first body of each file."""
    rigs = load_rigs()
    features = []
    for path in paths:
        clip = read_clips(path)[0]
        motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, rigs))
        features.append(word_features(motion.positions, motion.rotations, motion.fps, config))
    return features


def train(sets: tuple[str, ...], seed: int = 0) -> TrainedNetwork:
    """The default network, trained on sets of CMU without labels."""
    words, network, recipe = WordConfig(), NetworkConfig(weights="own", seed=seed, max_words=60_000), Recipe()
    paths = clips_of(sets)
    made = train_words(features_of(paths, words), words, network, recipe=recipe)
    about = {
        "sets": list(sets),
        "data_sha256": hash_files(paths, recordings()),
        "network": asdict(network),
        "recipe": asdict(recipe),
        "revision": revision(),
        "source": SOURCE,
    }
    return replace(made, metrics={**made.metrics, **about})


def pretrained_for(name: str, folder: Path) -> Path:
    """The pretrained weights; for a set that they are trained on, such as have been trained without it, in a folder."""
    if name not in SETS:
        return PRETRAINED_WORDS.file
    path = folder / f"without_{name}.safetensors"
    if not path.exists():
        train(tuple(each for each in SETS if each != name)).save(path)
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description="Train the word network that comes with the package.")
    parser.add_argument("--without", choices=SETS)
    parser.add_argument("--out", type=Path, default=PRETRAINED_WORDS.file)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    network = train(tuple(name for name in SETS if name != given.without), given.seed)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    network.save(given.out)
    beside = {
        **network.metrics,
        "words_trained_on": network.metrics["words"],
        "words": asdict(network.words),
        "architecture": network.architecture,
    }
    given.out.with_suffix(".json").write_text(json.dumps(beside, indent=2) + "\n", encoding="utf-8")
    print(f"{given.out}: {given.out.stat().st_size} bytes, {network.metrics['words']} words")


if __name__ == "__main__":
    main()

"""Train the pretrained networks of clips and of pieces: `python -m bench.pretrained_descriptors descriptors|submotion`.

Only sets whose terms allow derived weights are used: CMU's. `--without` leaves one out, to measure on it.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

from motionlake.arrays import Float32Array
from motionlake.deephums.batches import mirrored, windows
from motionlake.deephums.config import PRETRAINED_DESCRIPTORS, PRETRAINED_SUBMOTION, DescriptorsConfig, SubmotionConfig
from motionlake.deephums.network import TrainedDescriptor
from motionlake.deephums.recipes import PRETRAINED
from motionlake.deephums.sequence import clip_sequence
from motionlake.deephums.submotions import TrainedSubmotion, train_submotion
from motionlake.deephums.training import TrainingClip, train_descriptor
from motionlake.formats import read_clips
from motionlake.motion.canonicalise import canonicalise
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs

from bench.pretrained_words import SETS, SOURCE, clips_of
from bench.record import hash_files, recordings, revision

WINDOW: Final = 150
FILES: Final = {"descriptors": PRETRAINED_DESCRIPTORS.file, "submotion": PRETRAINED_SUBMOTION.file}


def sequences_of(paths: Sequence[Path]) -> list[Float32Array]:
    """`clip_sequence` of the first body of each file, long takes in windows of five seconds."""
    rigs = load_rigs()
    found = []
    for path in paths:
        clip = read_clips(path)[0]
        motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, rigs))
        found.extend(windows(clip_sequence(motion.positions, motion.fps), WINDOW))
    return found


def train_descriptors(sequences: Sequence[Float32Array], about: Mapping[str, Any], seed: int = 0) -> TrainedDescriptor:
    """Sketches in the principal directions of pieces and of their mirror images."""
    config = DescriptorsConfig(supervision="none", weights="own", seed=seed)
    clips = [TrainingClip(each) for sequence in sequences for each in (sequence, mirrored(sequence))]
    made = train_descriptor(clips, config, recipe=PRETRAINED)
    return replace(made, metrics={**about, **made.metrics, "training": asdict(made.recipe)})


def train_pieces(
    sequences: Sequence[Float32Array], about: Mapping[str, Any], seed: int = 0, steps: int = 0
) -> TrainedSubmotion:
    """The default second network; 0 steps are the configuration's."""
    config = SubmotionConfig(weights="own", seed=seed)
    config = replace(config, steps=steps) if steps else config
    network, losses = train_submotion(sequences, config, progress=_tell)
    return TrainedSubmotion(config, network, {**about, "clips": len(sequences), "loss": round(losses[-1], 5)})


def _about(sets: tuple[str, ...], paths: Sequence[Path]) -> dict[str, Any]:
    digest = hash_files(paths, recordings())
    return {"sets": list(sets), "data_sha256": digest, "revision": revision(), "source": SOURCE}


def _tell(done: int, steps: int, loss: float) -> None:
    print(f"{done} of {steps}, loss {loss:.4f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="Train the networks of motion descriptors that come with the package.")
    parser.add_argument("which", choices=FILES)
    parser.add_argument("--without", choices=SETS)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=0, help="epochs or steps; 0: as the recipe has it")
    given = parser.parse_args()
    sets = tuple(name for name in SETS if name != given.without)
    paths = clips_of(sets)
    sequences, about = sequences_of(paths), _about(sets, paths)
    made: TrainedDescriptor | TrainedSubmotion
    if given.which == "descriptors":
        made = train_descriptors(sequences, about, given.seed)
        named = {"recipe": made.config.recipe, "descriptors": asdict(made.config)}
    else:
        made = train_pieces(sequences, about, given.seed, given.rounds)
        named = {"submotion": asdict(made.config)}
    out = given.out or FILES[given.which]
    out.parent.mkdir(parents=True, exist_ok=True)
    made.save(out)
    out.with_suffix(".json").write_text(json.dumps({**made.metrics, **named}, indent=2) + "\n", encoding="utf-8")
    print(f"{out}: {out.stat().st_size} bytes, {len(sequences)} clips")


if __name__ == "__main__":
    main()

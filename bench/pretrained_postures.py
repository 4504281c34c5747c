"""Train the pretrained posture dictionary: `python -m bench.pretrained_postures [--without SET] [--out FILE]`.

Only sets whose terms allow derived weights are used: CMU's. `--without` leaves one out, to measure on it.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, replace
from pathlib import Path

from motionlake.pesta import occupancy
from motionlake.pesta.config import PRETRAINED_POSTURES, PosturesConfig
from motionlake.pesta.dictionary import PostureDictionary
from motionlake.pesta.dictionary_fitting import fit_dictionary

from bench.pretrained_words import SETS, SOURCE, clips_of, features_of
from bench.record import hash_files, recordings, revision

POSTURES = 60_000


def train(sets: tuple[str, ...], seed: int = 0) -> PostureDictionary:
    """The default dictionary, trained on sets of CMU without labels."""
    config = PosturesConfig(weights="own", seed=seed, max_postures=POSTURES)
    paths = clips_of(sets)
    made = fit_dictionary(features_of(paths, config.frames), config)
    about = {
        "sets": list(sets),
        "clips": len(paths),
        "data_sha256": hash_files(paths, recordings()),
        "revision": revision(),
        "source": SOURCE,
    }
    return replace(made, metrics={**made.metrics, **about})


def main() -> None:
    parser = argparse.ArgumentParser(description="Train the posture dictionary that comes with the package.")
    parser.add_argument("--without", choices=SETS)
    parser.add_argument("--out", type=Path, default=PRETRAINED_POSTURES.file)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    dictionary = train(tuple(name for name in SETS if name != given.without), given.seed)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    dictionary.save(given.out)
    beside = {**dictionary.metrics, "trained_on": dictionary.metrics["postures"], "postures": asdict(dictionary.config)}
    given.out.with_suffix(".json").write_text(json.dumps(beside, indent=2) + "\n", encoding="utf-8")
    print(f"{given.out}: {given.out.stat().st_size} bytes, {occupancy.line(dictionary.metrics)}")


if __name__ == "__main__":
    main()

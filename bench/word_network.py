"""The paper's word network beside others: `python -m bench.word_network [--seeds N] [--rows ROW,...] [--keep FOLDER]
[--from RECORD] [--minutes N] [--device DEVICE] [SET ...]`.

The network of Deep Motifs (section 3.3) is trained by the recipe of section 3.4 on the words of a set, without labels,
until its loss on held-out words stops falling (`[network] recipe = "deep_motifs"`); with random negatives, which are
the paper's, and with semi-hard ones. Rows "with patience" wait six times as long for the loss to fall, so that nobody
need ask what more steps would have done. Beside it stand raw words, their principal components, and both closed forms
("linear", "moves"). Every row goes on as in `bench.representation`: K motifs, tf-idf signatures, exact Earth Mover's
Distance, leave one out over whole clips. Each row has `--seeds` seeds on every set.

Last comes the choice of a default: each set is left out in turn, and the row is taken that is best on the others.

It takes hours on two cores, and minutes on CUDA (`--device cuda`; "device" of a run says what trained it): after
`--minutes` nothing more is begun, and the record names what is left. `--from` a record of the same recordings goes on:
what it holds is taken from it, and not measured anew. `--keep` goes on from units that were done, here or elsewhere.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.deep_motifs.config import NEGATIVES, NetworkConfig
from motionlake.deep_motifs.words.deep_motifs import DeepMotifs
from motionlake.deep_motifs.words.training import train_words
from motionlake.motion.features import WordConfig, word_windows
from threadpoolctl import threadpool_limits

from bench.canonical_sets import SETS, features, load
from bench.record import hash_files, record, recordings
from bench.representation import SEEDS, Embedding, K, learned, raw, score, shallow
from bench.units import Found, in_processes, unit_options

NAME: Final = "word-network"
STEPS: Final = 2_000  # at most
PATIENT_STEPS: Final = 10_000
PLAIN: Final[Mapping[str, Embedding]] = {
    "raw words": raw,
    "principal components": shallow,
    "linear": partial(learned, architecture="linear"),
    "moves (default)": learned,
}
PATIENCE: Final = 6 * DeepMotifs().patience


@dataclass(frozen=True)
class Paper:
    """How the paper's network is trained."""

    negatives: str
    patient: bool = False

    @property
    def steps(self) -> int:
        """At most."""
        return PATIENT_STEPS if self.patient else STEPS

    @property
    def recipe(self) -> DeepMotifs:
        return replace(DeepMotifs(), patience=PATIENCE) if self.patient else DeepMotifs()


PAPER: Final = {
    **{f"the paper's ({negatives} negatives)": Paper(negatives) for negatives in NEGATIVES},
    **{f"the paper's ({negatives} negatives) with patience": Paper(negatives, patient=True) for negatives in NEGATIVES},
}
# Set, row and seed.
Unit = tuple[str, str, int]


def trained(
    clips: list[Float32Array], paper: Paper, seed: int, checkpoint: Path | None, device: str
) -> tuple[list[Float32Array], Found]:
    """Embedded words of each clip, and how the network that embeds them was trained."""
    words = WordConfig()
    config = NetworkConfig(recipe="deep_motifs", negatives=paper.negatives, seed=seed, steps=paper.steps)
    started = time.process_time()
    network = train_words(clips, words, config, deep_motifs=paper.recipe, checkpoint=checkpoint, device=device)
    seconds = time.process_time() - started
    found = {
        **network.metrics, "seconds_of_processor": round(seconds, 1), "measured_every": paper.recipe.every,
        "device": named(device),
    }  # fmt: skip
    return [network.embed(word_windows(clip, words)) for clip in clips], found


def named(device: str) -> str:
    """What trains: the processor, or the name of the card."""
    return device if device == "cpu" else torch.cuda.get_device_name(device)


def measure(keep: Path | None, device: str, unit: Unit) -> dict[str, Found]:
    """MAP and NN of one row on one set, on one thread; of a network its training too, that a folder may keep."""
    name, row, seed = unit
    with threadpool_limits(limits=1):
        clips = load(name)
        seen = features(clips, WordConfig())
        about: Found = {}
        if row in PAPER:
            checkpoint = keep / f"{name}-{list(PAPER).index(row)}-{seed}.safetensors" if keep else None
            embedded, about = trained(seen, PAPER[row], seed, checkpoint, device)
        else:
            embedded = PLAIN[row](seen, WordConfig(), seed)
        scores = score(embedded, clips, seed)
    return {row: {"map": scores.map, "nn": scores.nn, **about}}


def units(names: list[str], rows: list[str], seeds: int) -> list[Unit]:
    """What is measured, seed by seed: first what all else is compared with."""
    order = sorted(rows, key=lambda row: row in PAPER)
    return [(name, row, seed) for seed in SEEDS[:seeds] for row in order for name in names]


def default_by_others(means: Mapping[str, Mapping[str, float]], names: list[str]) -> dict[str, dict[str, Any]]:
    """{set: the row that is best on the others by mean MAP, and the MAP of it and of today's default here}."""
    whole = {row: found for row, found in means.items() if set(names) <= set(found)}
    today, chosen = "moves (default)", {}
    if len(names) < 2 or today not in whole:
        return {}
    for left_out in names:
        others = [name for name in names if name != left_out]
        best = max(whole, key=lambda row: float(np.mean([whole[row][name] for name in others])))
        chosen[left_out] = {"row": best, "map": whole[best][left_out], "today": whole[today][left_out]}
    return chosen


def _said(unit: Unit) -> str:
    return "{}, {}, seed {}".format(*unit)


Runs = dict[str, dict[str, dict[int, Found]]]


def earlier_runs(path: Path | None, data: str) -> Runs:
    """{row: {set: {seed: found}}} of a record.

    Raises:
        SystemExit: it is not of this bench, or of other recordings.
    """
    if path is None:
        return {}
    known = json.loads(path.read_text(encoding="utf-8"))
    if known["name"] != NAME or known["data_sha256"] != data:
        sys.exit(f"{path} is no record of this bench of the same recordings")
    return {
        row: {name: {int(seed): found for seed, found in seeds.items()} for name, seeds in by_set.items()}
        for row, by_set in known["figures"]["runs"].items()
    }


def mean_maps(runs: Runs) -> dict[str, dict[str, float]]:
    """{row: {set: mean average precision over seeds}}."""
    return {
        row: {name: float(np.mean([run["map"] for run in seeds.values()])) for name, seeds in found.items()}
        for row, found in runs.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="The paper's word network beside others.")
    parser.add_argument("sets", nargs="*", default=list(SETS), metavar="SET", help=f"of {', '.join(SETS)}")
    unit_options(parser)
    parser.add_argument("--rows", type=lambda text: text.split(","), default=[*PLAIN, *PAPER], help="these alone")
    parser.add_argument("--from", dest="earlier", type=Path, metavar="RECORD", help="go on from a record")
    parser.add_argument("--device", default="cpu", help="that networks are trained on: cpu, cuda")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="after which nothing more is begun")
    given = parser.parse_args()
    paths = [p for name in given.sets for p in (recordings() / SETS[name].folder).rglob("*") if p.is_file()]
    data, until = hash_files(paths, recordings()), time.monotonic() + 60 * given.minutes
    runs = earlier_runs(given.earlier, data)
    chosen = [
        (name, row, seed)
        for name, row, seed in units(given.sets, given.rows, given.seeds)
        if seed not in runs.get(row, {}).get(name, {})
    ]
    left = list(chosen)
    for unit, found in in_processes(
        partial(measure, given.keep, given.device), chosen, given.processes, _said, given.keep
    ):
        name, row, seed = unit
        runs.setdefault(row, {}).setdefault(name, {})[seed] = found[row]
        left.remove(unit)
        if time.monotonic() > until:
            break
    means = mean_maps(runs)
    print("MAP".ljust(28) + "".join(name.rjust(12) for name in given.sets))
    for row, of_sets in means.items():
        cells = (f"{of_sets[name]:.3f}" if name in of_sets else "" for name in given.sets)
        print(row.ljust(28) + "".join(cell.rjust(12) for cell in cells))
    others = default_by_others(means, given.sets)
    for name, one in others.items():
        print(f"without {name}: {one['row']}, here {one['map']:.3f} (moves {one['today']:.3f})")
    print(*(f"left: {_said(unit)}" for unit in left), sep="\n")
    result = {
        "map": means, "runs": runs, "default_by_others": others, "steps_at_most": STEPS,
        "steps_at_most_patient": PATIENT_STEPS, "patience": [DeepMotifs().patience, PATIENCE], "k": K,
        "from": given.earlier and given.earlier.stem, "left": [_said(unit) for unit in left],
    }  # fmt: skip
    print(record(NAME, result, data))


if __name__ == "__main__":
    main()

"""Temporal segmentation through the lake (Deep Motifs, section 6.2): `python -m bench.segmentation [SEED ...]`.

"cmu_exercises": leave one take out; every take is segmented by what the other four teach. "cmu_86": the take
86_01 is segmented by clips of other sets that show walking, jumping, punching and kicking, chosen by their
label or description alone (`TAUGHT`). Each has a lake of its own. "pretrained": with the pretrained word network, as
`motionlake segment` has it by default; the seed is that of the motifs alone. Else the network is trained on that
lake's clips without their labels. Shares of words, means over seeds.

The configuration is the first of `VARIANTS`; the others stand beside it to show what each choice does.
"""

from __future__ import annotations

import csv
import shutil
import sys
import tempfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.deep_motifs.config import PRETRAINED_WORDS
from motionlake.deep_motifs.segmentation import LabelledRange, SegmentationConfig
from motionlake.deep_motifs.signatures import Corpus
from motionlake.deep_motifs.word_segmentation import WordSegmentation
from motionlake.evaluation.segmentation import SegmentationScores, segmentation_scores, segments_of
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.corpus import read_corpus
from motionlake.lake.layout import Lake
from motionlake.retrieval.segment_methods import Config, segment_method

from bench.lakes import make_lake, run_all
from bench.record import record, recordings

SEEDS: Final = (0, 1, 2)
CONFIG: Final = SegmentationConfig()
WORDS: Final = WordSegmentation()
# (configuration, mirror images teach too); the first is what is reported.
VARIANTS: Final[dict[str, tuple[Config, bool]]] = {
    "default": (WORDS, True),
    "words, no mirror images": (WORDS, False),
    "words, every border alike": (replace(WORDS, rest=0.0), True),
    "words, borders for nothing": (replace(WORDS, border=0.0), True),
    "signatures": (CONFIG, True),
    "signatures, the paper's": (replace(CONFIG, reach=0), False),
}
ORIGINS: Final = {"pretrained": PRETRAINED_WORDS.file, "own": None}  # of the word network
EXERCISES_FLOOR: Final = {"13_29": 0.938, "13_30": 0.975, "13_31": 0.925, "14_14": 0.847, "14_20": 0.969}
TAKE: Final = "cmu_86/clips/86_01.amc"
# What 86_01 is taught by: (set, column of its labels, their text, class of 86_01).
TAUGHT: Final = (
    ("bandai1", "label", "walk", "walk"),
    ("bandai1", "label", "punch", "punch"),
    ("bandai1", "label", "kick", "leg_kick"),
    ("cmu_bvh", "description", "walk", "walk"),
    ("cmu_bvh", "description", "slow walk", "walk"),
    ("cmu_bvh", "description", "brisk walk", "walk"),
    ("cmu_bvh", "description", "jump up and down, hop on one foot", "jump"),
    ("cmu_bvh", "description", "punch/strike", "punch"),
    ("hdm05", "label", "hopBothLegs1hops", "jump"),
    ("hdm05", "label", "kickLFront1Reps", "leg_kick"),
)
Scores = dict[str, float]


def exercises(lake: Lake) -> dict[str, dict[str, SegmentationScores]]:
    """Scores of each take under each variant."""
    with reading(lake) as con:
        corpus = read_corpus(con)
        ranges = segments_of(con, corpus)
        takes = sorted({r.clip for r in ranges})
        taught = {clip: [r for r in ranges if r.clip != clip] for clip in takes}
        return _scores(con, lake, corpus, ranges, taught)


def taught_by_other_sets(lake: Lake) -> dict[str, dict[str, SegmentationScores]]:
    """Scores of 86_01 under each variant."""
    with reading(lake) as con:
        corpus = read_corpus(con)
        clip = corpus.positions[TAKE]
        taught = [
            LabelledRange(i, 0, c.frames, c.label)
            for i, c in enumerate(corpus.clips)
            if c.label is not None and i != clip
        ]
        return _scores(con, lake, corpus, segments_of(con, corpus), {clip: taught})


def _scores(
    con: Connection, lake: Lake, corpus: Corpus, truth: Sequence[LabelledRange], taught: dict[int, list[LabelledRange]]
) -> dict[str, dict[str, SegmentationScores]]:
    found = {}
    for name, (config, mirrored) in VARIANTS.items():
        method = segment_method(con, lake, corpus, config, mirrored=mirrored)
        method.read([*taught, *(r.clip for ranges in taught.values() for r in ranges)])
        found[name] = {
            Path(corpus.clips[clip].clip).stem: segmentation_scores(
                method, clip, ranges, [r for r in truth if r.clip == clip]
            )
            for clip, ranges in taught.items()
        }
    return found


def teaching_clips(folder: Path) -> Path:
    """A folder of the clips of `TAUGHT` with their classes in labels.csv."""
    target = folder / "taught"
    rows = []
    for name in dict.fromkeys(entry[0] for entry in TAUGHT):
        source = recordings() / name
        classes = {(column, text): label for of, column, text, label in TAUGHT if of == name}
        with (source / "labels.csv").open(newline="", encoding="utf-8") as handle:
            for row in csv.DictReader(handle):
                label = next((classes[key] for key in classes if row.get(key[0]) == key[1]), None)
                if label is None:
                    continue
                copy = target / name / Path(row["file"]).relative_to("clips")
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source / row["file"], copy)
                rows.append((copy.relative_to(target).as_posix(), label))
        for skeleton in (source / "clips").rglob("*.asf"):
            shutil.copyfile(skeleton, target / name / skeleton.relative_to(source / "clips"))
    with (target / "labels.csv").open("w", newline="", encoding="utf-8") as handle:
        csv.writer(handle).writerows([("file", "label"), *rows])
    return target


def means(runs: Sequence[Mapping[str, Mapping[str, SegmentationScores]]]) -> dict[str, dict[str, Scores]]:
    """Each measure's mean over the seeds, of every take and of their mean, under each variant."""
    found: dict[str, dict[str, Scores]] = {}
    for name in runs[0]:
        takes = {take: _mean([asdict(run[name][take]) for run in runs]) for take in runs[0][name]}
        found[name] = {**takes, "mean": _mean(list(takes.values()))}
    return found


def _mean(rows: Sequence[Mapping[str, Any]]) -> Scores:
    return {key: float(np.mean([row[key] for row in rows if row[key] is not None])) for key in rows[0]}


def main() -> None:
    seeds = [int(word) for word in sys.argv[1:]] or list(SEEDS)
    runs: dict[str, list[dict[str, dict[str, SegmentationScores]]]] = defaultdict(list)
    with tempfile.TemporaryDirectory(prefix="bench-segmentation-") as folder:
        alone = make_lake(Path(folder) / "exercises", [recordings() / "cmu_exercises"])
        other = make_lake(Path(folder) / "other", [recordings() / "cmu_86", teaching_clips(Path(folder))])
        for seed in seeds:
            for name, lake, measure in (("cmu_exercises", alone, exercises), ("cmu_86", other, taught_by_other_sets)):
                for origin, weights in ORIGINS.items():
                    run_all(lake, seed, weights)
                    runs[f"{name}, {origin}"].append(measure(lake))
                    print(f"seed {seed}", flush=True)
                    show(f"{name}, {origin}", means(runs[f"{name}, {origin}"][-1:]))
    figures = {name: means(each) for name, each in runs.items()}
    print("\nmeans")
    for name, found in figures.items():
        show(name, found)
    print(f"  floor of cmu_exercises: {EXERCISES_FLOOR}, mean {np.mean(list(EXERCISES_FLOOR.values())):.3f}")
    print(record("segmentation", figures | {"seeds": seeds, "floor": EXERCISES_FLOOR}))


def show(name: str, found: Mapping[str, Mapping[str, Scores]]) -> None:
    for variant, takes in found.items():
        mean = takes["mean"]
        each = " ".join(f"{scores['accuracy_known']:.3f}" for take, scores in takes.items() if take != "mean")
        print(
            f"  {name:25} {variant:26} accuracy_known {mean['accuracy_known']:.3f} ({each})  "
            f"or unknown {mean['accuracy_known_or_unknown']:.3f}  accuracy {mean['accuracy']:.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()

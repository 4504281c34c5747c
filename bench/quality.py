"""Faults planted in real recordings, and how many `motionlake check` finds: `python -m bench.quality [--usual]`.

Every fault is planted once in every clip in which it can be, at a place and of a severity drawn by seed. A planted clip
counts as found where a fault of that kind overlaps what was planted, and the same clip without it as a false alarm
where one of that kind is told; so precision counts faults that a recording had before against the check. Thresholds of
a set, and what evidence of frame rates is usual, are chosen on the other sets (`bench.quality_thresholds`): no figure
is of a set on which anything was chosen.

Where a fault is usual in a set, `outstanding` counts what stands out of it, as `check` tells it for clips of a lake:
the set is as it is but for the one planted clip, or has one planted clip in five (`outstanding_of_fifth`). How far out
that is, is chosen on the other sets as well. Precision of `bones` takes alarms for right that the lengths of bones
confirm (`bench.quality_bones`).

Of a frame rate there are three answers: wrong, right, and not known. Recall counts those that are told wrong among
those of which anything is told; `recall_of_all` among all.

Clips of CMU begin with a T-pose of calibration, which is cut off but for the row that counts how often it is found. In
some a joint turns by more than 10,000 degrees a second from one frame to the next. No person's does (shoulders of
pitchers come to 7,500 to 7,700: Seroyer et al. 2010, PMC3445080), so those are damaged, and `clean` are the others;
alarms in all clips are counted as well. The salsa of CMU
says 120 frames a second and plays twice as fast as people dance; that clips of CMU say 120 and are of 60 is known
(una-dinosauria/cmu-mocap, pull request 2). It is taken as 60, and what its 120 is told to be is a row of its own. The
bar is precision and recall of 0.9, and false alarms in 5 % of clean CMU clips.
"""

from __future__ import annotations

import argparse
import random
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from motionlake.motion.quality import Highest, Quality, Recording, check, in_dataset
from motionlake.motion.quality.clock import Usual, evidence, judged
from motionlake.motion.quality_config import QualityConfig

from bench.canonical_sets import SETS, LabelledClip, LabelledSet, read
from bench.plants import PLANTS, Planted, Subject
from bench.quality_bones import FRAMES, confirmed
from bench.quality_thresholds import chosen_config, chosen_spreads, harmonic, is_found, planted, scores, usual
from bench.quality_usual import FOLDS, SPREADS, Dataset
from bench.record import hash_files, record, recordings

CMU: Final = "cmu_bvh"
READ: Final = {
    CMU: LabelledSet(CMU, "description"), "hdm05": SETS["hdm05"], "bandai1": SETS["bandai1"],
    "cmu_dance": LabelledSet("cmu_dance", "label"), "utd_mhad": SETS["utd_mhad"],
}  # fmt: skip
CALIBRATED: Final = (CMU, "cmu_dance")  # sets whose first frame is a T-pose
POSITIONS: Final = ("utd_mhad",)  # sets without rotations
SALSA: Final = "salsa"
MOST: Final = 120  # clips of a set, drawn by seed
LONGEST: Final = 20.0  # seconds of a clip that are used
FASTEST: Final = 10_000.0  # degrees a second
BAR: Final = 0.9


@dataclass(frozen=True)
class Tested:
    """A set of recordings.

    Attributes:
        subjects: its clips, at their own rates.
        halved: whether each says twice its rate.
        damaged: whether a joint of each turns as no person's does.
        calibration: how many of the clips begin with a T-pose that was found.
        evidence: of the frame rate of each.
    """

    subjects: Sequence[Subject]
    halved: Sequence[bool]
    damaged: Sequence[bool]
    calibration: str
    evidence: Sequence[Mapping[str, float]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--usual", action="store_true", help="What evidence of frame rates is usual; nothing is kept.")
    parser.add_argument("--most", type=int, default=MOST, help="Clips of a set; fewer than all keep nothing.")
    given = parser.parse_args()
    sets = {name: read_set(name, given.most) for name in READ}
    if given.usual:
        print(usual([_honest(tested) for tested in sets.values()]))
        return
    config = QualityConfig()
    scored = {name: scores(tested.subjects, config) for name, tested in sets.items()}
    spread = {name: _spread_scores(tested, config) for name, tested in sets.items()}
    figures = {}
    for name, tested in sets.items():
        others = chosen_config([of for other, of in scored.items() if other != name], config)
        spreads = chosen_spreads([of for other, of in spread.items() if other != name], SPREADS)
        known = usual([_honest(of) for other, of in sets.items() if other != name])
        figures[name] = measured(tested, others, known, spreads)
        _show(name, figures[name])
    figures["all"] = {"faults": _together([one["faults"] for one in figures.values()])}
    _show("all", figures["all"])
    if given.most == MOST:
        files = [path for each in READ.values() for path in (recordings() / each.folder).rglob("*") if path.is_file()]
        print(record("quality", figures, hash_files(files, recordings())))


def _show(name: str, found: Mapping[str, Any]) -> None:
    print(f"{name}: " + ", ".join(f"{key} {value}" for key, value in found.items() if isinstance(value, int | str)))
    for kind, row in found["faults"].items():
        for name, one in {kind: row, **{key: value for key, value in row.items() if isinstance(value, dict)}}.items():
            told = {key: value for key, value in one.items() if not isinstance(value, dict)}
            print(f"  {name:14}" + "".join(f"{key} {_shown(value):8}" for key, value in told.items()))


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _honest(tested: Tested) -> list[Mapping[str, float]]:
    """The evidence of clips that say their own rate."""
    return [found for found, halved in zip(tested.evidence, tested.halved, strict=True) if not halved]


def read_set(name: str, most: int) -> Tested:
    clips = read(READ[name])
    clips.sort(key=lambda clip: clip.name)
    random.Random(0).shuffle(clips)
    clips = clips[:most]
    first = 1 if name in CALIBRATED else 0
    whole = [_subject(clip, 0, name) for clip in clips] if first else []
    told = sum(any(f.kind == "tpose_start" for f in check(s.recording, QualityConfig()).faults) for s in whole)
    subjects = [_subject(clip, first, name) for clip in clips]
    halved = [name == "cmu_dance" and clip.label == SALSA for clip in clips]
    own = [replace(s, recording=replace(s.recording, fps=s.recording.fps / 2)) if h else s
           for s, h in zip(subjects, halved, strict=True)]  # fmt: skip
    return Tested(
        own, halved, [_damaged(s.recording) for s in own], f"{told} of {len(whole)}",
        [evidence(s.recording) for s in own],
    )  # fmt: skip


def _subject(clip: LabelledClip, first: int, name: str) -> Subject:
    stop = first + round(LONGEST * clip.fps)
    assert clip.rest_offsets is not None
    twist = name not in POSITIONS
    recording = Recording(clip.positions[first:stop], clip.rotations[first:stop], clip.fps, twist)
    return Subject(clip.name, recording, clip.rest_offsets)


def _damaged(recording: Recording) -> bool:
    cosines = np.abs((recording.rotations[1:] * recording.rotations[:-1]).sum(axis=2))
    turned = np.degrees(2 * np.arccos(np.clip(cosines, 0, 1))) * recording.fps
    return bool(recording.twist and turned.max(initial=0.0) > FASTEST)


def measured(tested: Tested, config: QualityConfig, known: Mapping[str, Usual], spreads: float) -> dict[str, Any]:
    """Of a set, with thresholds that were chosen on others."""
    subjects = tested.subjects
    plain = [check(subject.recording, config) for subject in subjects]
    rates = [_told(found, known, config) for found in tested.evidence]
    kinds = [
        {f.kind for f in quality.faults} - {"fps"} | ({"fps"} if rate == "wrong" else set())
        for quality, rate in zip(plain, rates, strict=True)
    ]
    dataset = Dataset(plain)
    faults = {
        kind: _row(kind, tested, dataset, kinds, config, spreads) for kind in PLANTS if kind != "fps"
    } | {"fps": _rate_row(tested, kinds, known, config)}  # fmt: skip
    whole = [not found for found, damaged in zip(kinds, tested.damaged, strict=True) if not damaged]
    return {
        "clips": len(subjects), "without_any": sum(not found for found in kinds), "damaged": sum(tested.damaged),
        "clean": len(whole), "clean_without_any": sum(whole), "calibration": tested.calibration,
        "rates": Counter(rates), "halved_told": _halved_told(tested, known, config),
        "thresholds": vars(config), "usual": {kind: vars(each) for kind, each in known.items()},
        "usual_faults": dataset.usual(), "spreads": spreads,
        "alarms": {s.name: sorted(found) for s, found in zip(subjects, kinds, strict=True) if found},
        "faults": faults,
    }  # fmt: skip


def _told(found: Mapping[str, float], known: Mapping[str, Usual], config: QualityConfig) -> str:
    odds = judged(found, known).odds
    return "wrong" if odds > config.fps_odds else "right" if 1 / odds > config.fps_odds else "not known"


def _halved_told(tested: Tested, known: Mapping[str, Usual], config: QualityConfig) -> str:
    """Of recordings that say twice their rate."""
    told = [
        _told(evidence(replace(s.recording, fps=s.recording.fps * 2)), known, config)
        for s, halved in zip(tested.subjects, tested.halved, strict=True)
        if halved
    ]
    return ", ".join(f"{count} {answer}" for answer, count in sorted(Counter(told).items()))


def _row(
    kind: str,
    tested: Tested,
    dataset: Dataset,
    kinds: Sequence[set[str]],
    config: QualityConfig,
    spreads: float,
) -> dict[str, Any]:
    """By the thresholds alone, and where that is usual in the set, what stands out."""
    made = _made(kind, tested)
    checked = {number: check(each.recording, config) for number, each in made.items()}
    found = sum(is_found(kind, made[number], quality.faults) for number, quality in checked.items())
    count = {"planted": len(made), "known": len(made)}
    row = _rates({**count, "found": found, **_alarms(kind, kinds, tested.damaged)})
    recordings = [subject.recording for subject in tested.subjects]
    by_bones = kind in FRAMES and not any(recording.twist for recording in recordings)
    if by_bones:
        row["bones"] = _with_bones(row, confirmed(kind, recordings, dataset.plain, config))
    if kind not in dataset.usual():
        return row
    trial = Trial(kind, dataset, made, checked, config)
    found, alarms = _outstanding(trial, spreads)
    row["outstanding"] = _rates({**count, "found": found, **_alarms(kind, alarms, tested.damaged)})
    if by_bones:
        usual = dataset.highest(spreads)
        told_plain = [in_dataset(quality, usual, config) for quality in dataset.plain]
        row["outstanding_bones"] = _with_bones(row["outstanding"], confirmed(kind, recordings, told_plain, config))
    many, told = _in_folds(trial, spreads)
    row["outstanding_of_fifth"] = _rates(
        {**count, "found": many, "plain": FOLDS * len(kinds), "alarms": told, "clean": 0, "clean_alarms": 0}
    )
    return row


def _with_bones(row: Mapping[str, Any], counts: Mapping[str, int]) -> dict[str, Any]:
    """With precision as it is where alarms that bones confirm are right."""
    false = (counts["told"] - counts["confirmed"]) * row["planted"] / row["plain"]
    told = row["found"] + false
    return {**counts, "precision": row["found"] / told if told else None}


def _made(kind: str, tested: Tested) -> dict[int, Planted]:
    """The clips in which a fault can be planted, by number, with it."""
    every = {number: planted(kind, subject, number) for number, subject in enumerate(tested.subjects)}
    return {number: made for number, made in every.items() if made is not None}


@dataclass(frozen=True)
class Trial:
    """One kind of fault planted in clips of a dataset.

    Attributes:
        made: what was planted, by number of the clip.
        checked: what the check found in each.
    """

    kind: str
    dataset: Dataset
    made: Mapping[int, Planted]
    checked: Mapping[int, Quality]
    config: QualityConfig

    def stands_out(self, number: int, usual: Mapping[str, Mapping[str, float]]) -> bool:
        """Whether what was planted in a clip stands out beside what is usual."""
        return is_found(self.kind, self.made[number], in_dataset(self.checked[number], usual, self.config).faults)


def _outstanding(trial: Trial, spreads: float) -> tuple[int, list[set[str]]]:
    """How many planted faults stand out, each where that clip alone has one, and what does in clips without."""
    found = 0
    for number, quality in trial.checked.items():
        with trial.dataset.planted({number: quality}):
            usual = trial.dataset.highest(spreads)
        found += trial.stands_out(number, usual)
    return found, _kinds(trial.dataset.plain, trial.dataset.highest(spreads), trial.config)


def _in_folds(trial: Trial, spreads: float) -> tuple[int, int]:
    """How many stand out where every fifth clip of the set has one, and alarms in all clips without, summed."""
    found = alarms = 0
    for fold in range(FOLDS):
        chosen = {number: quality for number, quality in trial.checked.items() if number % FOLDS == fold}
        with trial.dataset.planted(chosen):
            usual = trial.dataset.highest(spreads)
        found += sum(trial.stands_out(number, usual) for number in chosen)
        alarms += sum(trial.kind in told for told in _kinds(trial.dataset.plain, usual, trial.config))
    return found, alarms


def _kinds(plain: Sequence[Quality], usual: Highest, config: QualityConfig) -> list[set[str]]:
    return [{fault.kind for fault in in_dataset(quality, usual, config).faults} for quality in plain]


def _spread_scores(tested: Tested, config: QualityConfig) -> dict[str, list[float]]:
    """How good each of `SPREADS` is on a set, by the faults that are usual in it."""
    dataset = Dataset([check(subject.recording, config) for subject in tested.subjects])
    scored: dict[str, list[float]] = {}
    for kind in dataset.usual():
        made = _made(kind, tested)
        checked = {number: check(each.recording, config) for number, each in made.items()}
        scored[kind] = []
        for spreads in SPREADS:
            found, kinds = _outstanding(Trial(kind, dataset, made, checked, config), spreads)
            scored[kind].append(harmonic(found, len(made), sum(kind in told for told in kinds), len(kinds)))
    return scored


def _alarms(kind: str, kinds: Sequence[set[str]], damaged: Sequence[bool]) -> dict[str, int]:
    clean = [found for found, bad in zip(kinds, damaged, strict=True) if not bad]
    return {
        "plain": len(kinds), "alarms": sum(kind in found for found in kinds), "clean": len(clean),
        "clean_alarms": sum(kind in found for found in clean),
    }  # fmt: skip


def _rate_row(
    tested: Tested, kinds: Sequence[set[str]], known: Mapping[str, Usual], config: QualityConfig
) -> dict[str, Any]:
    made: list[Planted] = [
        each
        for number, (subject, halved) in enumerate(zip(tested.subjects, tested.halved, strict=True))
        if not halved and (each := planted("fps", subject, number)) is not None
    ]
    told = Counter(_told(evidence(each.recording), known, config) for each in made)
    honest = [(k, d) for k, d, halved in zip(kinds, tested.damaged, tested.halved, strict=True) if not halved]
    counts = _alarms("fps", [k for k, _ in honest], [d for _, d in honest])
    return _rates({"planted": len(made), "found": told["wrong"], "known": told["wrong"] + told["right"], **counts})


def _rates(counts: Mapping[str, int]) -> dict[str, Any]:
    # As many clips without as with the fault, so that precision does not depend on where it could be planted.
    made, found, known = (counts[name] for name in ("planted", "found", "known"))
    false = counts["alarms"] * made / counts["plain"] if counts["plain"] else 0.0
    return {
        **counts, "recall": found / known if known else None, "recall_of_all": found / made if made else None,
        "precision": found / (found + false) if found + false else None,
        "alarm_rate": counts["alarms"] / counts["plain"] if counts["plain"] else None,
        "clean_alarm_rate": counts["clean_alarms"] / counts["clean"] if counts["clean"] else None,
    }  # fmt: skip


def _together(sets: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    names = ("planted", "found", "known", "plain", "alarms", "clean", "clean_alarms")
    return {kind: _rates({name: sum(one[kind][name] for one in sets) for name in names}) for kind in sets[0]}


if __name__ == "__main__":
    main()

"""Known rig maps hidden from the solver and looked for again: `python -m bench.rigs`.

Every rig map: on all clips of its sets of recordings, or on a made body of its joint tree that walks where there are
none. Share of the joints of the map, and of the limb chains, that are found, with the names of the file and with
numbers in their place. The bars are 95 % of joints and all chains with names, and 90 % of chains with numbers.

Then how sure the solver is: of the joints that it is so sure of, how many are right, over the made bodies and every
20th clip of each set, in four ways (`tests/hidden_maps.py`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.formats import read_clips
from motionlake.motion.clip import SourceClip

from bench.record import hash_files, record, recordings
from tests.hidden_maps import Judged, found_again, judged_ways
from tests.rig_bodies import RIGS, walker
from tests.rig_samples import SETS

SHARES: Final = ("joints", "chains", "joints, numbers", "chains, numbers")
BARS: Final = {"joints": 0.95, "chains": 1.0, "chains, numbers": 0.9}
SURE: Final = (0.0, 0.2, 0.5, 0.8, 0.9, 0.95)
Figures = dict[str, float]


def main() -> None:
    folder = recordings()
    files = {name: sorted(folder.glob(each.pattern)) for name, each in SETS.items()}
    figures: dict[str, Any] = {}
    print(f"{'':26}{'clips':>6}" + "".join(f"   {share}" for share in SHARES))
    for name, clips in _bodies(files):
        figures[name] = found = measured(clips)
        shares = "".join(f"{found[share]:.4f}".rjust(len(share) + 3) for share in SHARES)
        missed = [f"{share} below {bar:g}" for share, bar in BARS.items() if found[share] < bar]
        print(f"{name:26}{found['clips']:>6}{shares}   {'; '.join(missed)}".rstrip(), flush=True)
    sure = calibration([clip for _, clips in _bodies({n: paths[::20] for n, paths in files.items()}) for clip in clips])
    print("\nof the joints that are at least so sure, right (and of all joints, so sure)")
    print(f"{'':26}" + "".join(f"{at:>16.0%}" for at in SURE))
    for way, found_sure in sure.items():
        told = [f"{share:.1%} ({part:.0%})" for share, part in found_sure.values()]
        print(f"{way:26}" + "".join(each.rjust(16) for each in told))
    figures["confidence"] = sure
    print(record("rigs", figures, hash_files([path for paths in files.values() for path in paths], folder)))


def _bodies(files: dict[str, list[Path]]) -> Iterator[tuple[str, Iterable[SourceClip]]]:
    """Clips of every rig, by its name and where they are from."""
    for name, paths in files.items():
        yield f"{SETS[name].rig} ({name})", (clip for path in paths for clip in read_clips(path))
    for name in RIGS:
        yield f"{name} (made)", [walker(name)]


def measured(clips: Iterable[SourceClip]) -> Figures:
    """How many clips of a rig there are, and the shares of their joints and of their limb chains that are found."""
    found: dict[str, list[bool]] = {share: [] for share in SHARES}
    count = 0
    for clip in clips:
        count += 1
        for named, suffix in ((True, ""), (False, ", numbers")):
            joints, chains = found_again(clip, named)
            found[f"joints{suffix}"] += joints
            found[f"chains{suffix}"] += chains
    return {"clips": count} | {share: float(np.mean(right)) for share, right in found.items()}


def calibration(clips: Sequence[SourceClip]) -> dict[str, dict[str, tuple[float, float]]]:
    """In each way of judging, by how sure at least: the share of joints that are right, and that are so sure."""
    found: dict[str, Judged] = {}
    for seed, clip in enumerate(clips):
        for way, joints in judged_ways(clip, seed).items():
            found.setdefault(way, []).extend(joints)
    return {way: {f"{at:g}": _right(joints, at) for at in SURE} for way, joints in found.items()}


def _right(joints: Judged, least: float) -> tuple[float, float]:
    sure = [right for confidence, right in joints if confidence >= least]
    return round(float(np.mean(sure)), 4), round(len(sure) / len(joints), 4)


if __name__ == "__main__":
    main()

"""Known rig maps hidden from the solver and looked for again: `python -m bench.rigs`.

Every rig map: on all clips of its sets of recordings, or on a made body of its joint tree that walks where there are
none. Share of the joints of the map, and of the limb chains, that are found, with the names of the file and with
numbers in their place. The bars are 95 % of joints and all chains with names, and 90 % of chains with numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.formats import read_clips
from motionlake.motion.clip import SourceClip

from bench.record import hash_files, record, recordings
from tests.hidden_maps import found_again
from tests.rig_bodies import RIGS, walker
from tests.rig_samples import SETS

SHARES: Final = ("joints", "chains", "joints, numbers", "chains, numbers")
BARS: Final = {"joints": 0.95, "chains": 1.0, "chains, numbers": 0.9}
Figures = dict[str, float]


def main() -> None:
    folder = recordings()
    files = {name: sorted(folder.glob(each.pattern)) for name, each in SETS.items()}
    figures: dict[str, Figures] = {}
    print(f"{'':26}{'clips':>6}" + "".join(f"   {share}" for share in SHARES))
    for name, clips in _bodies(files):
        figures[name] = found = measured(clips)
        shares = "".join(f"{found[share]:.4f}".rjust(len(share) + 3) for share in SHARES)
        missed = [f"{share} below {bar:g}" for share, bar in BARS.items() if found[share] < bar]
        print(f"{name:26}{found['clips']:>6}{shares}   {'; '.join(missed)}".rstrip(), flush=True)
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


if __name__ == "__main__":
    main()

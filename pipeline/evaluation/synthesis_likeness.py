"""Descriptors of made and real motions, and the classes that they are recognised as."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from motionlake.arrays import Float64Array, FloatArray
from motionlake.evaluation.measures.synthesis_likeness import recognise, recognised
from motionlake.evaluation.synthesis_trials import Begun, Trial

# [n, d] descriptors of n motions, each positions [F, 21, 3] and frames a second.
Describe = Callable[[Sequence[tuple[Float64Array, float]]], FloatArray]


class Likeness:
    """Descriptors of motions, and the classes that they are recognised as."""

    def __init__(
        self, trials: Sequence[Trial], begins: Sequence[Begun], known: Sequence[Begun], describe: Describe
    ) -> None:
        self.real = describe([(each.after, each.fps) for each in begins])
        self.known = describe([(each.after, each.fps) for each in known])
        self.made = describe([(trial.made.positions, trial.made.fps) for trial in trials])
        place = {id(each): i for i, each in enumerate(begins)}
        self._wanted = [trial.wanted for trial in trials]
        self._beside = [place[id(trial.real)] for trial in trials]
        rows: dict[str, list[int]] = {}
        for i, each in enumerate(known):
            rows.setdefault(each.motion.clip, []).append(i)
        labels = [each.motion.label for each in known]
        own = [rows.get(each.motion.clip, []) for each in begins]
        either = [
            sorted({*rows.get(trial.seed.motion.clip, []), *rows.get(trial.real.motion.clip, [])}) for trial in trials
        ]
        self._seen = recognise(self.known, labels, self.made, either)
        self._seen_real = recognise(self.known, labels, self.real, own)

    def recognised(self, others: Sequence[int], own: Sequence[int]) -> dict[str, Any] | None:
        """Of trials from other classes' seeds and from own ones, as many real clips beside the former."""
        if not others:
            return None
        wanted = [self._wanted[i] for i in others]
        made = recognised(wanted, [self._seen[i] for i in others])
        real = recognised(wanted, [self._seen_real[self._beside[i]] for i in others])
        alone = recognised([self._wanted[i] for i in own], [self._seen[i] for i in own]) if own else None
        return {
            "made": made, "real": real, "ratio": made / real if real else None, "own_seeds": alone, "n": len(others)
        }  # fmt: skip

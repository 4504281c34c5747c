"""The measures of synthesis against controls: real motion must be told from what is made of it, each in its own way.

On real recordings: walks of cmu_bvh and martial dances of cmu_dance, every second clip unseen.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest
from motionlake.evaluation.synthesis.motions import UNITS

from bench.glogen.controls import CONTROLS, EXPECTED
from bench.glogen.long import recorded_stretch
from bench.glogen.measured import rows
from bench.glogen.sets import clips_of

SETS = {"walk": 1, "martial": 1}  # every so many clips
BIG, ABOUT = 1.5, 0.3  # times; share by which what is the same may differ
# What a positive control may differ by where real clips differ as much from one another: eight dances, each its own.
OTHERS = 0.6
NOTHING = 1e-3  # what is less is none


@cache
def measured(name: str) -> Mapping[str, Mapping[str, float | None]]:
    stretches = [recorded_stretch(clip) for clip in clips_of(name)[:: SETS[name]]]
    return rows(stretches[1::2], stretches[::2])


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("measure", EXPECTED)
def test_controls_move_each_measure_as_they_must(recordings: Path, name: str, measure: str) -> None:
    found = measured(name)
    for control, way in EXPECTED[measure].items():
        real = found["known" if measure.startswith("nearest_real") else "real"][measure]
        value = found[control][measure]
        assert real is not None, (measure, control)
        assert value is not None, (measure, control)
        said = f"{measure} of {control}: {value:.4g}, real {real:.4g}"
        if way == "more":
            assert value > max(BIG * real, NOTHING), said
        elif way == "less":
            assert value < real / BIG or value < NOTHING, said
        else:
            share = OTHERS if control in {"known", "nearest"} else ABOUT
            assert abs(value - real) <= max(share * abs(real), NOTHING), said


def test_every_measure_and_every_control_has_its_part() -> None:
    told = {name.partition(".")[0] for name in EXPECTED}
    assert set(UNITS) - {"path_turns", "path_circling"} <= told
    assert set(CONTROLS) - {"real", "circling"} == {control for ways in EXPECTED.values() for control in ways}


@pytest.mark.parametrize("name", SETS)
def test_copies_are_told_by_rank(recordings: Path, name: str) -> None:
    found = measured(name)
    z = {control: found[control]["nearest_real.z"] for control in ("real", "known", "nearest")}
    assert z["real"] == pytest.approx(0, abs=1e-9)
    assert z["nearest"] is not None
    assert z["known"] is not None
    assert z["nearest"] < -2 < z["known"]


@pytest.mark.parametrize("measure", ["path_turns", "path_circling"])
def test_a_path_that_bends_to_one_side_turns(recordings: Path, measure: str) -> None:
    found = measured("walk")  # who dances has no path that would be straight
    circling, real, sunk = (found[control][measure] for control in ("circling", "real", "sunk"))
    assert circling is not None
    assert real is not None
    assert circling > 3 * real
    assert sunk == pytest.approx(real)

"""What the benches of PESTA choose and count."""

from __future__ import annotations

from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.evaluation.pesta.measuring import Segments
from motionlake.pesta.config import AlignmentConfig, PosturesConfig
from motionlake.pesta.dictionary import NearestCode, PostureDictionary
from motionlake.pesta.nearest import symmetric_costs
from motionlake.pesta.strings import Repository, SymbolDistances
from scipy.spatial.distance import cdist

from bench.canonical_sets import LabelledClip
from bench.pesta.gaps import Form, form_costs
from bench.pesta.measuring import GAPS3, STA3
from bench.pesta.recipes import bag_distances, chosen
from bench.pesta.windows import Window, score_windows, windows

RATE = 30.0
A, B = (0, 60, "a"), (60, 150, "b")


def test_windows_are_those_of_a_class_that_another_take_shows() -> None:
    takes: list[Segments] = [(A, B), ((0, 100, "b"),)]
    found = windows(takes, [150, 100], [RATE, RATE])
    # 45 frames, 15 apart; those at 0, 15 and 30 of the first take are mostly of "a", which the other does not show.
    assert found == [Window(0, start, start + 45, "b") for start in (45, 60, 75, 90, 105)] + [
        Window(1, start, start + 45, "b") for start in (0, 15, 30, 45)
    ]


def test_windows_without_an_answer_count_as_wrong() -> None:
    points = np.arange(6, dtype=np.float32)[:, None]
    dictionary = PostureDictionary(PosturesConfig(m=6), NearestCode(points), points, points, {})
    still, moving = np.zeros(150, dtype=np.int32), np.repeat(np.arange(1, 6, dtype=np.int32), 30)
    codes = [np.concatenate([still[:75], moving[:75]]), moving]
    clip = LabelledClip(np.zeros((150, 21, 3)), np.zeros((150, 21, 4)), RATE, "", "")
    segments: list[Segments] = [((0, 150, "a"),), ((0, 150, "a"),)]
    with (
        mock.patch("bench.pesta.windows.clips_of", return_value=[clip, clip]),
        mock.patch("bench.pesta.windows.segments_of", return_value=segments),
    ):
        found = score_windows("", dictionary, codes, AlignmentConfig(stride=2))
    # Those of the first take that begin at 0, 15 and 30 show one symbol.
    assert (found["n"], found["unanswered"]) == (16, 3)
    assert found["answered_p_at_2"] == pytest.approx(1)
    assert found["p_at_2"] == pytest.approx(13 / 16)


def test_the_default_is_what_the_other_sets_choose() -> None:
    def row(sta: float, bags: float) -> dict[str, dict[str, float]]:
        return {"mean": {"sta": sta, "bags": bags}}

    rows = {
        "one": {"x": row(0.9, 0.1), "y": row(0.2, 0.1)},
        "two": {"x": row(0.3, 0.1), "y": row(0.8, 0.2)},
        "three": {"x": row(0.3, 0.2), "y": row(0.5, 0.1)},
    }
    found = chosen(rows)["sta"]
    assert {name: each["chosen"] for name, each in found.items()} == {"one": "y", "two": "x", "three": "x"}
    assert found["one"]["here"] == 0.2
    assert found["one"]["of_others"] == pytest.approx(0.65)
    assert found["one"]["best_here"] == "x"


def test_bags_of_the_same_symbols_are_alike() -> None:
    codes = [np.array([0, 0, 1]), np.array([1, 0, 0, 0, 0, 1]), np.array([2, 2])]
    apart = bag_distances(codes, 3)
    assert apart[0, 1] == pytest.approx(0, abs=1e-7)
    assert apart[0, 2] == pytest.approx(2**0.5)


@given(
    st.lists(st.lists(st.integers(0, 5), min_size=1, max_size=9), min_size=2, max_size=4),
    st.integers(0, 99),
)
def test_forms_of_gaps_are_those_of_strided_alignment(strings: list[list[int]], seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(6, 3))
    distances = SymbolDistances.of(cdist(points, points).astype(np.float32))
    repository, unit = Repository.of([np.array(s, dtype=np.int32) for s in strings]), np.float32(distances.mean)
    gaps = Form(clip=(GAPS3.clip_gap, GAPS3.clip_gap), query=(GAPS3.query_gap, GAPS3.query_gap))
    capped = SymbolDistances.of(np.minimum(distances.matrix / unit, np.float32(0.7)))
    for form, expected in (
        (Form(), symmetric_costs(repository, distances, STA3) / unit),
        (gaps, symmetric_costs(repository, distances, GAPS3) / unit),
        (Form(cap=0.7), symmetric_costs(repository, capped, STA3)),
    ):
        np.testing.assert_allclose(form_costs(repository, distances, form), expected, rtol=1e-4, atol=1e-5)

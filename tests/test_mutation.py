"""Faults that are planted on purpose: which there are, where they go, and what changes no result."""

from __future__ import annotations

from bench.mutation.__main__ import figures_of, known_explanations
from bench.mutation.groups import GROUPS
from bench.mutation.mutants import change, mutants_of, planted, sample
from bench.mutation.tree import ROOT, _users

SOURCE = """from __future__ import annotations
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    SIZE = 1

@njit(cache=True)
def first(x: int | None, y: float = 2.0) -> int | None:
    if x < 3:
        raise ValueError(f"{x + 1} is too small")
    return list(zip([x], [y], strict=True))[0]

def second(x):
    return x * 5
"""


def changes(functions: tuple[str, ...] = ()) -> set[tuple[str, str]]:
    found = mutants_of("x.py", SOURCE, functions)
    return {change(SOURCE, planted(SOURCE, mutant.operator, mutant.occurrence)) for mutant in found}


def test_what_may_change_a_result_is_changed_and_nothing_else() -> None:
    every = changes()
    assert ("if x < 3:", "if x <= 3:") in every
    assert ("if x < 3:", "if not x < 3:") in every
    assert ("return x * 5", "return x / 5") in every
    assert ("return x * 5", "return x * 6") in every
    assert {before for before, _ in every} == {
        "if x < 3:",
        "return x * 5",
        "def first(x: int | None, y: float = 2.0) -> int | None:",
        "return list(zip([x], [y], strict=True))[0]",
    }
    assert all("strict=True" in after for before, after in every if before.startswith("return list"))
    assert all("int | None" in after and "-> int | None:" in after for before, after in every if "def" in before)
    assert {before for before, _ in changes(("second",))} == {"return x * 5"}


def test_a_larger_sample_holds_the_smaller_and_takes_a_place_once() -> None:
    path = "pipeline/pesta/symbols.py"
    every = list(mutants_of(path, (ROOT / path).read_text(encoding="utf-8")))
    small, large = sample(every, 5, 1), sample(every, 20, 1)
    assert set(small) < set(large)
    assert len({mutant.place for mutant in large}) == 20
    assert sample(every, 5, 2) != small
    assert sample(every, None, 1) == every


def test_modules_tests_and_explanations_are_there() -> None:
    for modules in GROUPS.values():
        for path, module in modules.items():
            assert all((ROOT / test).is_file() for test in module.tests)
            source = (ROOT / path).read_text(encoding="utf-8")
            for name in module.functions:
                assert f"def {name}(" in source, f"{name} of {path}"
    for path, before, after in known_explanations():
        lines = [line.strip() for line in (ROOT / path).read_text(encoding="utf-8").splitlines()]
        assert all(line in lines for line in before.splitlines()), f"{path} has no {before} any more"
        assert before != after


def test_kernels_are_compiled_anew_of_all_modules_that_hold_the_changed_one() -> None:
    users = _users(ROOT)
    assert "motionlake.pesta.scan" in users["pipeline/pesta/kernels.py"]
    assert "motionlake.retrieval.alignment" in users["pipeline/pesta/kernels.py"], "by way of others"
    assert "motionlake.pesta.kernels" not in users["pipeline/pesta/scan.py"]


def test_a_rate_of_nothing_is_none() -> None:
    assert figures_of([])["rate"] is None

"""The small faults that can be planted in a module: those of Cosmic Ray that may change what it does."""

from __future__ import annotations

import difflib
import random
import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from cosmic_ray.ast import Visitor, ast_nodes, get_ast
from cosmic_ray.operators.provider import OperatorProvider

_ARITHMETIC: Final = {"Add", "Sub", "Mul", "Div", "FloorDiv", "Mod"}
_BITS: Final = {"BitAnd", "BitOr", "BitXor"}
_SHIFTS: Final = {"LShift", "RShift"}
_ORDER: Final = {"Lt", "LtE", "Gt", "GtE", "Eq", "NotEq"}
# What may stand for one another: what never could, such as a shift for a sum, would be found by any test.
_ALIKE: Final = (_ARITHMETIC, _BITS, _SHIFTS, _ORDER, {"Is", "IsNot"}, {"In", "NotIn"})
_OPERATORS: Final = OperatorProvider()
# Arguments that guard, or make faster, and change no result; decorators that do no more.
_NO_RESULT: Final = {"cache", "nogil", "strict", "frozen", "slots", "kw_only", "repr", "copy"}
_DECORATORS: Final = {
    "njit",
    "guvectorize",
    "vectorize",
    "abstractmethod",
    "cache",
    "lru_cache",
    "dataclass",
    "overload",
}


@dataclass(frozen=True)
class Mutant:
    """A module with one fault.

    Attributes:
        path: of the module, relative to the repository.
        function: that holds the fault; "" outside of any.
        operator: of Cosmic Ray.
        occurrence: which of the places where the operator applies.
        line: of the fault, from 1.
        column: from 0.
    """

    path: str
    function: str
    operator: str
    occurrence: int
    line: int
    column: int

    @property
    def place(self) -> tuple[str, int, int, str]:
        """Where it is and of which family: of several at a place, a sample takes one."""
        return self.path, self.line, self.column, self.operator.split("_")[0]

    @property
    def name(self) -> str:
        return f"{self.path}:{self.line}:{self.column} {self.operator} {self.occurrence}"


class _Planted(Visitor):  # type: ignore[misc]
    """Applies an operator at one of the places where it can be."""

    def __init__(self, operator: Any, occurrence: int) -> None:
        self._operator, self._left = operator, occurrence

    def visit(self, node: Any) -> Any:
        for index, _ in enumerate(self._operator.mutation_positions(node)):
            if self._left == 0:
                node = self._operator.mutate(node, index)
            self._left -= 1
        return node


def planted(source: str, operator: str, occurrence: int) -> str:
    """A module's text with one fault."""
    code: str = _Planted(_OPERATORS[operator](), occurrence).walk(get_ast(source)).get_code()
    return code


def mutants_of(path: str, source: str, functions: Collection[str] = ()) -> Iterator[Mutant]:
    """Every fault of a module that may change what it does.

    Args:
        path: of the module, relative to the repository.
        source: its text.
        functions: that are looked at, with what is defined in them; all of the module where none are named.
    """
    nodes = [(node, _functions(node)) for node in ast_nodes(get_ast(source))]
    for name in _operators():
        operator, occurrence = _OPERATORS[name](), -1
        for node, within in nodes:
            for (line, column), _ in operator.mutation_positions(node):
                occurrence += 1
                if (not functions or set(within) & set(functions)) and not _of_no_effect(node, name):
                    yield Mutant(path, ".".join(reversed(within)), name, occurrence, line, column)


def sample(mutants: Sequence[Mutant], count: int | None, seed: int) -> list[Mutant]:
    """So many of them by chance, at most one a place, and all those of a smaller sample; with None all there are."""
    if count is None:
        return list(mutants)
    chance = random.Random(seed)
    places: dict[tuple[str, int, int, str], list[Mutant]] = defaultdict(list)
    for mutant in mutants:
        places[mutant.place].append(mutant)
    chosen = [chance.choice(places[place]) for place in sorted(places)]
    chance.shuffle(chosen)
    return sorted(chosen[:count], key=lambda mutant: mutant.place)


@cache
def _operators() -> tuple[str, ...]:
    return tuple(name for name in _OPERATORS if not _OPERATORS[name].arguments() and _may_stand(name))


def _may_stand(operator: str) -> bool:
    """Whether an operator puts something of the same kind in the place of another."""
    pair = re.fullmatch(r"Replace(?:Binary|Comparison)Operator_([A-Za-z]+)_([A-Za-z]+)", operator)
    if pair is None:
        return not operator.startswith("ReplaceUnaryOperator_") or "Delete" in operator
    return any({pair[1], pair[2]} <= alike for alike in _ALIKE)


def _above(node: Any) -> Iterator[tuple[Any, Any]]:
    """(node, the one above it), upwards."""
    while node.parent is not None:
        yield node, node.parent
        node = node.parent


def _functions(node: Any) -> list[str]:
    """The names of the functions and classes that hold a node, the innermost first."""
    return [above.name.value for _, above in _above(node) if above.type in ("funcdef", "classdef")]


def _of_no_effect(node: Any, operator: str) -> bool:
    """Whether a fault at a node changes nothing that a program does right: types, messages, guards, compilation."""
    if operator == "RemoveDecorator":
        return bool(_DECORATORS & set(re.findall(r"\w+", node.get_code(include_prefix=False))))
    return any(_silent(below, above) for below, above in ((None, node), *_above(node)))


def _silent(below: Any, above: Any) -> bool:
    kind = above.type
    if kind in ("annassign", "tfpdef"):
        return below is above.children[1] or kind == "tfpdef"
    if kind == "funcdef":
        return below is above.annotation
    if kind == "raise_stmt":
        return True
    if kind == "assert_stmt":
        return below is not above.children[1]
    if kind == "decorator":
        return bool(_DECORATORS & set(re.findall(r"\w+", above.get_code(include_prefix=False))))
    if kind == "argument":
        return above.children[0].get_code(include_prefix=False) in _NO_RESULT
    if kind == "if_stmt":
        return "TYPE_CHECKING" in above.children[1].get_code()
    return False


def change(before: str, after: str) -> tuple[str, str]:
    """The lines of two texts that differ, without their indents: of the first, and of the second."""
    old, new = before.splitlines(), after.splitlines()
    gone, come = [], []
    for tag, i, j, k, m in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if tag != "equal":
            gone += old[i:j]
            come += new[k:m]
    return "\n".join(line.strip() for line in gone), "\n".join(line.strip() for line in come)

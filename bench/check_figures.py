"""Figures in docs are in the records that docs name beside them: `python -m bench.check_figures`.

A section of a page is what stands between two headings. Where it names records (`bench/results`), every figure in it, a
number with a decimal point that is neither code nor a place in a paper, is in one of them: as it is, as per cent, in
thousands or thousandths, or in millions, rounded to as many digits as the page has. A section that says which bench
measured it, and names no record, is wrong too. What is wrong is printed, a line each, and the exit status is then 1.

That a figure is in a record does not say that it is the right one: of figures that were altered by up to a tenth, the
check misses some, the more the longer the record (`--power` says how many).
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array

from bench.check_records import NAME, ROOT
from bench.record import RESULTS

FIGURE: Final = re.compile(r"(?<![\w./-])(\d{0,3}(?:,\d{3})*\.\d+)(?![\w.]*\d)")
PLACE: Final = re.compile(
    r"\b(?:[Ss]ections?|[Ee]quations?|§|[Tt]ables?|[Ff]ig(?:\.|ures?))\s*[\d.]+(?:(?:,| and| to)\s+[\d.]+)*"
)
CODE: Final = re.compile(r"```.*?```|`[^`]*`", re.DOTALL)
HEADING: Final = re.compile(r"^#+ ", re.MULTILINE)
BENCH: Final = re.compile(r"\bbench\.[a-z]|\bmake bench-")
SCALES: Final = (1, 100, 1000, 1e-3, 1e-6)


@dataclass(frozen=True)
class Section:
    """Part of a page: its heading, the records and the figures that it names, and whether it names a bench."""

    page: str
    heading: str
    records: frozenset[str]
    figures: tuple[str, ...]
    measured: bool

    @property
    def name(self) -> str:
        return f"{self.page}: {self.heading}"


def sections(page: Path) -> Iterator[Section]:
    """Of a page, in their order; before the first heading there is one without a heading."""
    text = page.read_text(encoding="utf-8")
    code = [slice(*match.span()) for match in CODE.finditer(text)]
    starts = [
        match.start() for match in HEADING.finditer(text) if not any(c.start <= match.start() < c.stop for c in code)
    ]
    for start, stop in zip([0, *starts], [*starts, len(text)], strict=True):
        part = text[start:stop]
        prose = PLACE.sub("", NAME.sub("", CODE.sub("", part)))
        heading = part.splitlines()[0].lstrip("# ") if HEADING.match(part) else ""
        found = tuple(match[1] for match in FIGURE.finditer(prose))
        yield Section(page.name, heading, frozenset(NAME.findall(part)), found, bool(BENCH.search(part)))


@cache
def numbers(record: Path) -> Float64Array:
    """Every number in the figures of a record; none of one that is not there."""
    if not record.is_file():
        return np.zeros(0)
    found = np.array(list(_numbers(json.loads(record.read_text(encoding="utf-8"))["figures"])), dtype=np.float64)
    return np.abs(found[np.isfinite(found)])


def _numbers(tree: Any) -> Iterator[float]:
    if isinstance(tree, bool):
        return
    if isinstance(tree, int | float):
        yield float(tree)
    elif isinstance(tree, dict | list):
        for each in tree.values() if isinstance(tree, dict) else tree:
            yield from _numbers(each)


def recorded(figure: str, known: Iterable[Float64Array]) -> bool:
    """Whether a figure, as a page has it, is a number of a record, rounded."""
    value, digits = float(figure.replace(",", "")), len(figure.partition(".")[2])
    most = 0.5 * 10.0**-digits * (1 + 1e-6)
    return any(np.any(np.abs(each * scale - value) <= most) for each in known for scale in SCALES)


def faults(pages: Iterable[Path], results: Path) -> Iterator[str]:
    """What is wrong with figures on pages."""
    for page in pages:
        for section in sections(page):
            yield from _of_section(section, results)


def _of_section(section: Section, results: Path) -> Iterator[str]:
    if not section.records:
        if section.measured and section.figures:
            yield f"{section.name}: names a bench and no record for {', '.join(section.figures)}"
        return
    known = [numbers(results / f"{name}.json") for name in section.records]
    missing = [figure for figure in section.figures if not recorded(figure, known)]
    if missing:
        yield f"{section.name}: {', '.join(missing)} are in none of {', '.join(sorted(section.records))}"


def power(pages: Iterable[Path], results: Path, seed: int = 0) -> tuple[int, int]:
    """How many figures were altered by up to a tenth, and how many of these the check would find."""
    rng, altered, found = np.random.default_rng(seed), 0, 0
    for section in (each for page in pages for each in sections(page) if each.records):
        known = [numbers(results / f"{name}.json") for name in section.records]
        for figure in section.figures:
            value, digits = float(figure.replace(",", "")), len(figure.partition(".")[2])
            other = f"{value * rng.uniform(0.9, 1.1):.{digits}f}"
            if other != f"{value:.{digits}f}":
                altered += 1
                found += not recorded(other, known)
    return altered, found


def main() -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    if "--power" in sys.argv[1:]:
        altered, seen = power(pages, RESULTS)
        print(f"{seen} of {altered} altered figures are found")
        return
    found = list(faults(pages, RESULTS))
    print("\n".join(found) or "figures of docs are in the records named beside them")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()

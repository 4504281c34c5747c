"""Every combination of what is aligned, how, and with which options: the shell, SQL and Python give the same answer, or
the same refusal in one line.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import motionlake as library
import numpy as np
import pytest
from motionlake.errors import UserError
from motionlake.lake.layout import open_lake
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.matches import best_matches
from motionlake.retrieval.alignment import AlignmentRangeSearcher, AlignmentSearcher
from motionlake.retrieval.protocol import Query, Scope

from tests.lakes import motionlake
from tests.test_align import by_sql, longest, without_nulls

KS = {"ranges": 3, "whole": 12, "window": 3}  # answers; some clips of the lake have one string
ASKED = ("clip", "clip range", "file", "file range")
WAYS: dict[str, dict[str, Any]] = {"ranges": {}, "whole": {"whole": True}, "window": {"window": 4}}
OPTIONS: tuple[dict[str, Any], ...] = (
    {},
    {"boundaries": "kept"},
    {"boundaries": "crossed"},
    {"boundaries": "dropped"},
    {"ways": "max"},
    {"ways": "mean"},
    {"ways": "query"},
    {"below": 3.0},
    {"path": True},
    {"gaps": True},
    {"boundaries": "crossed", "path": True, "below": 4.0, "stride": 3},
    {"gaps": True, "path": True},
)
# What makes no sense: way, option, and what is said of it.
REFUSED = {
    ("ranges", "ways"): "ways: is for",
    ("window", "ways"): "ways: is for",
    ("whole", "boundaries"): "whole: compares whole clips; leave",
    ("window", "gaps"): "aligned without gaps: switch gaps off",
}
MADE = "MOTIONLAKE_DATA" not in os.environ  # made clips repeat so evenly that nothing is nearer over a boundary
FLAGS = {"path": ["--path"], "gaps": ["--gaps"], "whole": ["--whole"]}


@pytest.fixture(scope="module")
def opened(built_lake: Path) -> Iterator[library.Lake]:
    with library.open_lake(built_lake) as lake:
        yield lake


def asked(lake: Path, clips_folder: Path, what: str) -> tuple[str, int | None, int | None]:
    clip, frames = longest(lake)
    source = str(clips_folder / clip.partition("/")[2]) if what.startswith("file") else clip
    return (source, 1, frames - 1) if what.endswith("range") else (source, None, None)


def in_the_shell(part: tuple[str, int | None, int | None], way: str, options: dict[str, Any]) -> list[Any]:
    words: list[Any] = ["align", part[0], "-k", KS[way], "--json"]
    for flag, value in (("--from", part[1]), ("--to", part[2])):
        words += [] if value is None else [flag, value]
    for name, value in (WAYS[way] | options).items():
        words += FLAGS.get(name, [f"--{name}", value])
    return words


def in_sql(part: tuple[str, int | None, int | None], way: str, options: dict[str, Any]) -> str:
    values = {name: "true" if value is True else repr(value) for name, value in options.items()}
    said = "".join(f", {name} := {value}" for name, value in values.items())
    source, start, stop = (f"'{part[0]}'", *("NULL" if value is None else value for value in part[1:]))
    if way == "ranges":
        return f"FROM align_motion({source}, {start}, {stop}, k := {KS[way]}{said})"
    if way == "whole":
        return f"FROM aligned_clips({source}, k := {KS[way]}, start := {start}, stop := {stop}{said})"
    return f"FROM align_windows({source}, 4, k := {KS[way]}, start := {start}, stop := {stop}{said})"


@pytest.mark.parametrize("what", ASKED)
@pytest.mark.parametrize("way", WAYS)
def test_all_options_are_had_everywhere(
    built_lake: Path, clips_folder: Path, opened: library.Lake, what: str, way: str
) -> None:
    part = asked(built_lake, clips_folder, what)
    plain, in_python = None, partial(opened.align, *part, KS[way])
    for options in OPTIONS:
        words = [*in_the_shell(part, way, options), "--lake", built_lake]
        refusal = next((said for (w, name), said in REFUSED.items() if w == way and name in options), None)
        if refusal is not None:
            run = motionlake(*words)
            assert (run.status, run.err.count("\n"), run.out) == (2, 1, ""), words
            assert refusal in run.err
            with pytest.raises(UserError, match=refusal):
                in_python(**WAYS[way], **options)
            continue
        run = motionlake(*words)
        assert run.status == 0, run.err
        rows = run.json
        assert rows, words
        assert without_nulls(in_python(**WAYS[way], **options)) == rows
        assert by_sql(built_lake, in_sql(part, way, options)) == rows
        plain = rows if plain is None else plain
        assert all(row["distance"] < options.get("below", np.inf) for row in rows)
        assert ("path" in rows[0]) == ("path" in options)
        assert ("stop_clip" in rows[0]) == (options.get("boundaries") == "crossed")
        if options in ({"boundaries": "kept"}, {"ways": "max"}, {"path": True}):
            assert [{k: v for k, v in row.items() if k != "path"} for row in rows] == plain
        if way == "window" and options == {"boundaries": "crossed"}:
            assert any(row["stop_clip"] != row["clip"] for row in rows) or MADE
        if way == "whole" and options in ({"gaps": True}, {"ways": "mean"}, {"ways": "query"}):
            pairs = [(row["distance"], other["distance"]) for row, other in zip(rows, plain, strict=True)]
            assert all(less <= greater for less, greater in pairs)  # of more that is allowed the least
            assert any(less < greater for less, greater in pairs) or MADE


@pytest.mark.parametrize("boundaries", ["kept", "crossed", "dropped"])
def test_symbols_are_aligned_over_boundaries_too(built_lake: Path, boundaries: Any) -> None:
    """The string that ends one clip and begins the next: crossed it costs nothing, dropped it is no answer."""
    searcher = AlignmentRangeSearcher(open_lake(built_lake), boundaries=boundaries, stride=1, paths=True)
    kept = searcher.strings
    first = next(i for i in range(len(kept.repository) - 1) if min(kept.repository.lengths[i : i + 2]) > 2)
    symbols = [*kept.repository.string(first)[-3:].tolist(), *kept.repository.string(first + 1)[:3].tolist()]
    said = f"k := NULL, stride := 1, path := true, below := 1.0, boundaries := '{boundaries}'"
    found = by_sql(built_lake, f"FROM align_symbols({symbols}, {said})")
    hits = searcher.in_symbols(symbols, 10**9, Scope(below=1.0))
    assert found == [hit.as_row() | {"path": paths_of(hit)} for hit in hits]
    costs = best_matches(symbols, kept.repository, kept.distances, 1, AlignmentConfig(stride=1), boundaries=boundaries)
    assert searcher.in_symbols(symbols, 1)[0].cost == costs[0].cost
    assert (costs[0].cost == 0) == (boundaries == "crossed")


def paths_of(hit: Any) -> list[dict[str, list[int]]]:
    return [{"query": list(step.query), "clip": list(step.clip)} for step in hit.path]


def test_the_path_of_a_whole_clip_is_that_of_its_cost(built_lake: Path) -> None:
    """One way by dynamic time warping, a path costs what its pairs are apart."""
    searcher = AlignmentSearcher(open_lake(built_lake), ways="query", method="dtw", paths=True)
    strings, (clip, _) = searcher.strings, longest(built_lake)
    own = strings.string_of(strings.positions[clip])
    (hits,) = searcher.search([Query(clip)], 5)
    for hit in hits:
        string = strings.string_of(strings.positions[hit.clip])
        assert hit.path is not None
        pairs = [
            (list(zip(own.starts, own.stops, strict=True)).index(step.query),
             list(zip(string.starts, string.stops, strict=True)).index(step.clip))
            for step in hit.path
        ]  # fmt: skip
        apart = [strings.distances.matrix[own.symbols[x], string.symbols[y]] for x, y in pairs]
        assert hit.distance == pytest.approx(sum(apart) / len(own.symbols), abs=1e-5)

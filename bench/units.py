"""Units of work over processes, and tables of means over seeds."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
from argparse import ArgumentParser
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from motionlake.lake.parts import replacing
from threadpoolctl import threadpool_limits

from bench.record import enter_machine

SEEDS: Final = (0, 1, 2)
# What is measured of one row of a table.
Found = dict[str, Any]
Unit = TypeVar("Unit")
DRAWN: Final = ("curve", "confusion")
COUNTS: Final = ("n", "symbols", "occupied")


def unit_options(parser: ArgumentParser, processes: int = 1) -> None:
    """--seeds, --processes and --keep, as `in_processes` takes them."""
    parser.add_argument("--seeds", type=int, default=len(SEEDS), choices=range(1, len(SEEDS) + 1))
    parser.add_argument("--processes", type=int, default=processes, help="at work side by side, one thread each")
    parser.add_argument("--keep", type=Path, help="folder from which a run that was interrupted goes on")


def in_processes(
    measure: Callable[[Unit], dict[str, Found]],
    units: Sequence[Unit],
    processes: int,
    say: Callable[[Unit], str],
    keep: Path | None = None,
) -> Iterator[tuple[Unit, dict[str, Found]]]:
    """(unit, what was found of each of its rows), as they are done; one thread each. A line is printed of each.

    A folder to keep holds a file of every unit that is done, from which a later run takes it; it is for one state of
    the code and of the recordings. It also names the machines that measured (`bench.record`).
    """
    if keep is None:
        yield from _measured(measure, units, processes, say)
        return
    keep.mkdir(parents=True, exist_ok=True)
    files = {repr(unit): keep / f"{hashlib.sha256(repr(unit).encode()).hexdigest()[:24]}.json" for unit in units}
    for unit in units:
        if files[repr(unit)].exists():
            yield unit, json.loads(files[repr(unit)].read_text())
    left = [unit for unit in units if not files[repr(unit)].exists()]
    if left:
        enter_machine(keep)
    for unit, found in _measured(measure, left, processes, say):
        with replacing(files[repr(unit)]) as path:
            path.write_text(json.dumps(found))
        yield unit, found


def _measured(
    measure: Callable[[Unit], dict[str, Found]], units: Sequence[Unit], processes: int, say: Callable[[Unit], str]
) -> Iterator[tuple[Unit, dict[str, Found]]]:
    if processes == 1:
        for done, unit in enumerate(units, 1):
            with threadpool_limits(limits=1):
                found = measure(unit)
            print(f"  {done}/{len(units)} {say(unit)}{_maps(found)}", flush=True)
            yield unit, found
        return
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), initializer=_alone) as pool:
        pending = {pool.submit(measure, unit): unit for unit in units}
        for done, future in enumerate(as_completed(pending), 1):
            found = future.result()
            print(f"  {done}/{len(units)} {say(pending[future])}{_maps(found)}", flush=True)
            yield pending[future], found


def _alone() -> None:
    threadpool_limits(limits=1)


def _maps(found: Mapping[str, Found]) -> str:
    key = next((key for key in ("top1", "map", "p_at_10") if any(key in row for row in found.values())), None)
    shown = [f"{name} {row[key]:.3f}" for name, row in list(found.items())[:6] if key in row] if key else []
    return ": " + ", ".join(shown) + (" ..." if len(found) > 6 else "") if shown else ""


def mean_of(runs: Sequence[Mapping[str, Any]]) -> Found:
    """Means of the numbers of a row over its seeds; of what is drawn (curves, confusions) the first seed's."""
    first = runs[0]
    return {key: _mean([run[key] for run in runs]) if key not in DRAWN else first[key] for key in first}


def _mean(values: Sequence[Any]) -> Any:
    if isinstance(values[0], Mapping):
        return {key: _mean([value[key] for value in values]) for key in values[0]}
    if isinstance(values[0], bool | int | float) and None not in values:
        return float(np.mean(values))
    return values[0]


def with_seeds(rows: Mapping[str, Mapping[int, Found]], drawn: Callable[[str], bool]) -> dict[str, Found]:
    """{row: {mean, seeds}}, what is kept: of seeds their numbers; of what is drawn the rows that `drawn` names."""
    kept = {}
    for name, runs in rows.items():
        mean = mean_of([runs[seed] for seed in sorted(runs)])
        left_out = () if drawn(name) else DRAWN
        kept[name] = {
            "mean": _rounded({key: value for key, value in mean.items() if key not in left_out}),
            "seeds": {seed: _rounded(_numbers(runs[seed])) for seed in sorted(runs)},
        }
    return kept


def _numbers(found: Found) -> Found:
    return {key: value for key, value in found.items() if not isinstance(value, Mapping | list)}


def _rounded(value: Any, digits: int = 5) -> Any:
    if isinstance(value, Mapping):
        return {key: _rounded(each, digits) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(each, digits) for each in value]
    return round(value, digits) if isinstance(value, float) else value


def table(title: str, rows: Mapping[str, Found], keys: Sequence[str]) -> str:
    """Lines of `with_seeds`: means over the seeds, and the least and the greatest of the first key."""
    width = max(map(len, [title, *rows])) + 2
    title, span = title.ljust(width), {key: max(len(key), 6) + 2 for key in keys}
    lines = [title + "".join(key.rjust(span[key]) for key in keys) + f"   {keys[0]} by seed"]
    for name, row in rows.items():
        cells = "".join(_cell(key, row["mean"].get(key)).rjust(span[key]) for key in keys)
        runs = [run[keys[0]] for run in row["seeds"].values()]
        spread = f"   {min(runs):.3f}-{max(runs):.3f}" if len(runs) > 1 else ""
        lines.append(name.ljust(width) + cells + spread)
    return "\n".join(lines)


def _cell(key: str, value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.0f}" if key in COUNTS else f"{value:.3f}"

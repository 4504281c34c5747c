"""`python -m bench.made [table|errors|blind|judge] ...`: made motion beside real motion, on clips left out.

table: classes by motion matching and by networks beside their recordings: travel, energy, diversity, feet, coverage and
density beside those of known clips, copies; also beside recordings by a body of constant bones. errors: what
follows the given poses after 80 to 640 ms, beside baselines. blind FOLDER: a page of pairs, real and made, with the key
in a file of its own. judge FOLDER: how often the guesses of guesses.csv there are right.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from motionlake.evaluation.synthesis.errors import MILLISECONDS

from bench.classes import CLASSES, OTHERS
from bench.glogen.dense import means
from bench.made import blind, errors, table
from bench.made.generators import RECIPES
from bench.made.splits import FOLDS, SPLITS, TUNED
from bench.made.windows import SHARES
from bench.record import hash_files, record, recordings
from bench.units import Found, in_processes
from bench.units import table as lines

SCORES: Final = ("travel_speed", "energy", "diversity", "skate_ratio")


def measure_table(given: argparse.Namespace) -> dict[str, Any]:
    units = [
        table.Unit(name, recipe, given.chosen, tuple(given.folds), given.epochs, given.generators)
        for recipe in given.recipes or RECIPES for name in given.splits or SPLITS
    ]  # fmt: skip
    found: dict[str, dict[str, Any]] = {}
    for unit, rows in in_processes(table.measure, units, given.processes, str, given.keep):
        found.setdefault(unit.split, {})[unit.recipe] = rows
        print(*_lines(rows), sep="\n", flush=True)
    return found


def _lines(rows: Mapping[str, Found]) -> list[str]:
    shown = []
    for label, row in rows.items():
        ratios = " ".join(f"{name} {row['ratio'].get(name, float('nan')):.3f}" for name in SCORES)
        feet = " ".join(f"{name} {row['made'][name]:.3f}/{row['real'][name]:.3f}" for name in table.WORST[:2])
        likeness = " ".join(f"{start} {_covered(spaces)}" for start, spaces in row["likeness"].items())
        kept = " ".join(f"{name} {row['rigid']['ratio'].get(name, float('nan')):.3f}" for name in SCORES[:3])
        shown.append(f"  {label}: {ratios} {feet} {likeness}")
        shown.append(
            f"    beside rigid: {kept} {_covered(row['rigid']['likeness']['from_unseen'])}"
            f"; known rigid reach {_covered(row['rigid']['reached'])}"
        )
    return shown


def measure_errors(given: argparse.Namespace) -> dict[str, Any]:
    units = [
        errors.Unit(name, method, fold, given.epochs, given.generators)
        for name in given.splits or TUNED for method in given.methods or errors.METHODS for fold in given.folds
    ]  # fmt: skip
    kept: dict[str, dict[str, list[Any]]] = {}
    for unit, rows in in_processes(errors.measure, units, given.processes, str, given.keep):
        for row, values in rows.items():
            kept.setdefault(unit.split, {}).setdefault(row, []).append(values)
    result = {name: {row: means(each) for row, each in rows.items()} for name, rows in kept.items()}
    for name, rows in result.items():
        shown = {row: {"mean": rows[row], "seeds": {0: rows[row]}} for row in errors.METHODS if row in rows}
        print(f"\n{lines(name, shown, [f'pose_{ms}' for ms in MILLISECONDS])}")
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("folder", nargs="?", type=Path, help="of blind and judge")
    parser.add_argument("--splits", nargs="+", choices=SPLITS)
    parser.add_argument("--recipes", nargs="+", choices=RECIPES)
    parser.add_argument("--methods", nargs="+", choices=errors.METHODS)
    parser.add_argument("--seed", type=int, default=0, help="of blind, and the first of table")
    parser.add_argument("--seeds", type=int, default=len(table.SEEDS))
    parser.add_argument("--folds", nargs="+", type=int, default=list(range(FOLDS)), choices=range(FOLDS))
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--epochs", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="a folder that keeps what is measured, to go on from")
    given = parser.parse_args()
    given.chosen = tuple(range(given.seed, given.seed + given.seeds))
    given.generators = given.keep and given.keep / "generators"
    given.keep = given.keep and given.keep / given.part
    PARTS[given.part](given)


def _recorded(name: str, found: Mapping[str, Any], kept: Path | None = None) -> None:
    folders = sorted({chosen.folder for chosen in (CLASSES | OTHERS).values()})
    files = [path for folder in folders for path in (recordings() / folder).rglob("*") if path.is_file()]
    print(f"wrote {record(f'made-{name}', found, hash_files(files, recordings()), kept=kept)}")


def _table(given: argparse.Namespace) -> None:
    _recorded("table", {"seeds": list(given.chosen), "splits": measure_table(given)}, given.keep)


def _errors(given: argparse.Namespace) -> None:
    _recorded("errors", measure_errors(given), given.keep)


def _covered(likeness: Mapping[str, Any]) -> str:
    return " ".join(
        f"{space} " + "/".join(f"{one['share'][name]:.2f} ({_between(one['interval'][name])})" for name in SHARES)
        for space, one in likeness.items()
    )


def _between(interval: Sequence[float]) -> str:
    return " to ".join(f"{edge:.2f}" for edge in interval)


def _folder(given: argparse.Namespace) -> Path:
    if given.folder is None:
        raise SystemExit(f"{given.part} needs a folder")
    return Path(given.folder)


def _blind(given: argparse.Namespace) -> None:
    page, key = blind.write(blind.pairs(given.pairs, given.seed), _folder(given))
    print(f"wrote {page}; the key is in {key.name} beside it, to be opened after judging")


def _judge(given: argparse.Namespace) -> None:
    folder = _folder(given)
    found: dict[str, Any] = {**blind.judged(folder / "key.json", folder / "guesses.csv")}
    found["key"] = json.loads((folder / "key.json").read_text(encoding="utf-8"))
    found["guesses"] = (folder / "guesses.csv").read_text(encoding="utf-8").splitlines()
    print({name: value for name, value in found.items() if name not in ("key", "guesses")})
    _recorded("judged", found)


PARTS: Final = {"table": _table, "errors": _errors, "blind": _blind, "judge": _judge}


if __name__ == "__main__":
    main()

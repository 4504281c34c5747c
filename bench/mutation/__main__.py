"""Plant small faults in modules that results hang on, and count those that tests find: `python -m bench.mutation`.

Faults are those of Cosmic Ray, at places drawn by chance in each group of modules (`groups`); each is planted in a copy
of the repository, in which the tests of its module run. A fault that makes tests run on and on is found by their time.
Of what is not found, `explained.toml` says why it changes no result: the rate is told with and without those.
`--keep FOLDER` goes on where a run with the same tests was stopped, and holds what the tests said.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import queue
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from bench.mutation.groups import GROUPS
from bench.mutation.mutants import Mutant, change, mutants_of, planted, sample
from bench.mutation.tree import Tree
from bench.record import record

PER_GROUP: Final = 40
SEED: Final = 23
LEAST_SECONDS: Final = 60.0  # of the processor that tests may take, most of them for kernels to be compiled again
TIMES: Final = 3.0  # how often the time that they take without a fault, kernels compiled anew
EXPLAINED: Final = Path(__file__).with_name("explained.toml")
NO_IMPORT: Final = "\nraise RuntimeError('a fault that any test finds')\n"


@dataclass(frozen=True)
class Outcome:
    """What tests made of a fault: "killed", "survived", "timed out", or "explained", where it survived by right."""

    group: str
    mutant: Mutant
    before: str
    after: str
    state: str
    seconds: float


class Runner:
    """Runs tests in some copies of the repository, and keeps how they ended."""

    def __init__(self, folder: Path, processes: int) -> None:
        self.folder = folder
        (folder / "logs").mkdir(parents=True, exist_ok=True)
        self._file = folder / "ended.jsonl"
        lines = self._file.read_text(encoding="utf-8").splitlines() if self._file.exists() else []
        self._ended: dict[str, tuple[str, float]] = {key: (how, s) for key, how, s in map(json.loads, lines)}
        self._trees: queue.SimpleQueue[Tree] = queue.SimpleQueue()
        self._made = [Tree(folder / f"copy-{i}") for i in range(processes)]
        for tree in self._made:
            self._trees.put(tree)

    def _key(self, tests: Sequence[str], path: str, text: str) -> str:
        return _digest(path, text, *(test + self.text(test) for test in tests))

    def text(self, path: str) -> str:
        """A file as the copies have it: the repository may change meanwhile."""
        return (self._made[0].root / path).read_text(encoding="utf-8")

    def close(self) -> None:
        for tree in self._made:
            tree.close()

    def warm(self, tests: Sequence[str]) -> float:
        """Run tests without a fault in every copy, so that kernels are compiled; the seconds that they take.

        Raises:
            SystemExit: they fail.
        """
        log = self.folder / "logs" / f"{Path(tests[0]).stem}.log"
        seconds = 0.0
        for tree in self._made:
            how, spent = tree.run(tests, log, 1200)
            seconds = max(seconds, spent)
            if how != "passed":
                sys.exit(f"{' '.join(tests)}: {how} without a fault: {log}")
        return seconds

    def knows(self, tests: Sequence[str], path: str, text: str) -> bool:
        """Whether an earlier run has found how tests end where a module has another text."""
        return self._key(tests, path, text) in self._ended

    def ended(self, tests: Sequence[str], path: str, text: str, seconds: float, name: str) -> tuple[str, float]:
        """How tests end where a module has another text, and their seconds."""
        key = self._key(tests, path, text)
        if key not in self._ended:
            tree = self._trees.get()
            try:
                self._ended[key] = tree.run(tests, self.folder / "logs" / f"{key[:16]}.log", seconds, path, text)
            finally:
                self._trees.put(tree)
            with self._file.open("a", encoding="utf-8") as file:
                print(json.dumps([key, *self._ended[key]]), file=file)
            print(f"  {self._ended[key][0]:9} {self._ended[key][1]:6.1f} s  {key[:16]}  {name}", flush=True)
        return self._ended[key]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"these alone, of {', '.join(GROUPS)}")
    parser.add_argument("--sample", type=int, default=PER_GROUP, help=f"faults a group (default {PER_GROUP})")
    parser.add_argument("--all", action="store_true", help="every fault, in place of a sample")
    parser.add_argument("--seed", type=int, default=SEED, help=f"of the sample (default {SEED})")
    parser.add_argument("--only", default="", metavar="TEXT", help="those of the sample that have this in their names")
    parser.add_argument("--processes", type=int, default=1, help="side by side (default 1)")
    parser.add_argument("--keep", type=Path, help="folder for what was found, to go on with")
    given = parser.parse_args()
    if unknown := sorted(set(given.groups) - set(GROUPS)):
        parser.error(f"{', '.join(unknown)}: no such group; there are {', '.join(GROUPS)}")
    with tempfile.TemporaryDirectory(prefix="mutation-") as temporary:
        runner = Runner(given.keep or Path(temporary), given.processes)
        try:
            outcomes = []
            for group in given.groups or GROUPS:
                chosen = sample(listed(runner, group), None if given.all else given.sample, given.seed)
                chosen = [mutant for mutant in chosen if given.only in mutant.name]
                outcomes += measured(runner, group, chosen, given.processes)
        finally:
            runner.close()
    figures = {group: figures_of([o for o in outcomes if o.group == group]) for group in given.groups or GROUPS}
    figures["all"] = figures_of(outcomes)
    show(figures, outcomes)
    if not given.only:
        left = [outcome for outcome in outcomes if outcome.state in ("survived", "explained")]
        record(
            "mutation",
            {
                "sample": None if given.all else given.sample, "seed": given.seed, "groups": figures,
                "left": [asdict(outcome) for outcome in left],
            },
            packages=("cosmic-ray", "pytest", "hypothesis"),
        )  # fmt: skip


def listed(runner: Runner, group: str) -> list[Mutant]:
    """Every fault of a group."""
    return [
        mutant
        for path, module in GROUPS[group].items()
        for mutant in mutants_of(path, runner.text(path), module.functions)
    ]


def measured(runner: Runner, group: str, chosen: Sequence[Mutant], processes: int) -> list[Outcome]:
    """How the tests end with each of some faults of a group.

    Raises:
        SystemExit: tests fail without a fault, or do not see the copy.
    """
    modules = GROUPS[group]
    sources = {path: runner.text(path) for path in dict.fromkeys(mutant.path for mutant in chosen)}
    texts = {mutant: planted(sources[mutant.path], mutant.operator, mutant.occurrence) for mutant in chosen}
    print(f"{group}: {len(chosen)} faults in {len(sources)} modules", flush=True)
    limits: dict[tuple[str, ...], float] = {}
    for mutant, text in texts.items():
        path, tests = mutant.path, modules[mutant.path].tests
        if tests not in limits and not runner.knows(tests, path, text):
            limits[tests] = max(LEAST_SECONDS, TIMES * runner.warm(tests))
            print(f"  without a fault {limits[tests] / TIMES:.1f} s at most: {' '.join(tests)}", flush=True)
            _check_seen(runner, path, tests, limits[tests])
    explained = known_explanations()

    def one(mutant: Mutant) -> Outcome:
        tests = modules[mutant.path].tests
        text = texts[mutant]
        before, after = change(sources[mutant.path], text)
        how, seconds = runner.ended(tests, mutant.path, text, limits.get(tests, LEAST_SECONDS), mutant.name)
        state = {"passed": "survived", "failed": "killed"}.get(how, how)
        if state == "survived" and (mutant.path, before, after) in explained:
            state = "explained"
        return Outcome(group, mutant, before, after, state, seconds)

    with ThreadPoolExecutor(processes) as pool:
        return list(pool.map(one, chosen))


def _check_seen(runner: Runner, path: str, tests: Sequence[str], seconds: float) -> None:
    text = runner.text(path) + NO_IMPORT
    if runner.ended(tests, path, text, seconds, f"{path} that cannot be imported")[0] == "passed":
        sys.exit(f"{path} of the copy is not what {' '.join(tests)} import")


def known_explanations() -> dict[tuple[str, str, str], str]:
    """Why faults change no result, by path and by the lines before and after."""
    entries = tomllib.loads(EXPLAINED.read_text(encoding="utf-8")).get("fault", [])
    return {(entry["path"], entry["before"], entry["after"]): entry["why"] for entry in entries}


def figures_of(outcomes: Iterable[Outcome]) -> dict[str, Any]:
    """How many faults were found; the shares of all, and of those that are not explained."""
    counts = Counter(outcome.state for outcome in outcomes)
    total, found = counts.total(), counts["killed"] + counts["timed out"]
    return {
        "mutants": total,
        **{state.replace(" ", "_"): counts[state] for state in ("killed", "timed out", "survived", "explained")},
        "rate": round(found / total, 4) if total else None,
        "rate_without_explained": round(found / (total - counts["explained"]), 4) if found else None,
    }


def show(figures: Mapping[str, Mapping[str, Any]], outcomes: Sequence[Outcome]) -> None:
    """Print the table, and what survived."""
    print(f"{'group':10}  mutants  killed  timed out  survived  explained    rate  without explained")
    for group, found in figures.items():
        print(
            f"{group:10} {found['mutants']:8} {found['killed']:7} {found['timed_out']:10} {found['survived']:9} "
            f"{found['explained']:10} {found['rate'] or 0:7.1%} {found['rate_without_explained'] or 0:18.1%}"
        )
    for outcome in outcomes:
        if outcome.state in ("survived", "explained"):
            mutant = outcome.mutant
            print(f"{outcome.state}: {mutant.path}:{mutant.line} in {mutant.function or 'the module'}")
            print(*(f"  - {line}" for line in outcome.before.splitlines()), sep="\n")
            print(*(f"  + {line}" for line in outcome.after.splitlines()), sep="\n")


def _digest(*texts: str) -> str:
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()


if __name__ == "__main__":
    main()

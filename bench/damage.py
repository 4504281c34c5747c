"""Damaged lakes: is any flip, cut or deletion answered from in silence, found by `verify --deep`, undone by `repair`?

`python -m bench.damage --flips 400 --losses 100` damages one file of a small lake at a time, of every kind in turn. The
controls: the sound lake answers, verifies as sound and is not changed by a repair; a blind check of the same damages
(none but DuckDB's and Arrow's own) shows how many would have been answered from.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import os
import random
import shutil
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import duckdb
from motionlake.cli.main import main as motionlake

from bench.record import hash_files, record, recordings
from tests.lakes import CLOCKS

SETS: Final = (("bandai1", "*.bvh"), ("hdm05", "*.amc"), ("utd_mhad", "*.npz"))


@dataclass(frozen=True)
class Said:
    """What a command said."""

    status: int
    out: str
    err: str


def command(*words: object) -> Said:
    """Run the command line in this process."""
    out, err, status, before = io.StringIO(), io.StringIO(), 0, sys.argv
    sys.argv = ["motionlake", *map(str, words)]
    try:
        with redirect_stdout(out), redirect_stderr(err):
            motionlake()
    except SystemExit as stop:
        status = stop.code if isinstance(stop.code, int) else 1
    finally:
        sys.argv = before
    return Said(status, out.getvalue(), err.getvalue())


def tables(lake: Path) -> dict[str, str]:
    """A digest of every table of a lake, without the columns that tell time."""
    found = {}
    with duckdb.connect() as con:
        con.execute("ATTACH $catalog AS lake (READ_ONLY)", {"catalog": str(lake / "catalog.duckdb")})
        con.execute("USE lake")
        for (name,) in con.execute("SELECT table_name FROM duckdb_tables() WHERE table_name <> 'runs'").fetchall():
            table = con.table(name)
            kept = ", ".join(f'"{c}"' for c in table.columns if c not in CLOCKS.get(name, ()))
            rows = sorted(map(repr, table.project(kept).fetchall()))
            found[name] = hashlib.sha256("\n".join(rows).encode()).hexdigest()
    return found


def make_lake(data: Path, folder: Path, each: int) -> Path:
    """A lake of the smallest clips of three formats, with settings of its own, brought up to date."""
    rows = ["file,label"]
    for name, pattern in SETS:
        base = data / name / "clips"
        for path in sorted(base.rglob(pattern), key=lambda p: (p.stat().st_size, p.name))[:each]:
            target = folder / "src" / name / path.relative_to(base)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
            rows.append(f"{target.relative_to(folder / 'src').as_posix()},{name}")
        for companion in base.rglob("*.asf"):
            shutil.copyfile(companion, folder / "src" / name / companion.relative_to(base))
    (folder / "src" / "labels.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    lake = folder / "lake"
    _must(command("init", lake))
    (lake / "config.toml").write_text("[motifs]\nk = 12\n\n[postures]\nm = 40\ndictionary = 'kmeans'\n", "utf-8")
    _must(command("ingest", folder / "src", "--lake", lake))
    _must(command("run", "all", "--lake", lake))
    return lake


def _must(said: Said) -> None:
    if said.status:
        sys.exit(said.err)


class Questions:
    """What is asked of a lake, and what it answers."""

    def __init__(self, lake: Path, folder: Path) -> None:
        rows = json.loads(
            command("sql", "SELECT clip FROM clips ORDER BY seconds DESC, clip", "--json", "--lake", lake).out
        )
        clip = rows[0]["clip"]
        bvh = next(row["clip"] for row in rows if row["clip"].endswith(".bvh"))
        self._out = folder / "exported.bvh"
        piece = ("--from", "0.1s", "--to", "1.2s", "--json")
        self._asked: dict[str, tuple[object, ...]] = {
            "search": ("search", clip, "--json"),
            "search by descriptor": ("search", clip, "--method", "descriptor", "--json"),
            "sql frames": ("sql", "SELECT sum(hash(f)) AS sum FROM frames f", "--json"),
            "sql embeddings": ("sql", "SELECT sum(hash(e)) AS sum FROM embeddings e", "--json"),
            "sql clips": ("sql", "SELECT clip, label, frames, part FROM clips ORDER BY clip", "--json"),
            "find": ("find", clip, *piece),
            "align": ("align", clip, *piece),
            "export": ("export", bvh, "-o", self._out),
        }

    def answers(self, lake: Path) -> dict[str, Said]:
        """Of every question; an exported file is part of the answer."""
        found = {}
        for name, words in self._asked.items():
            self._out.unlink(missing_ok=True)
            said = command(*words, "--lake", lake)
            if name == "export" and self._out.exists():
                said = Said(said.status, hashlib.sha256(self._out.read_bytes()).hexdigest(), said.err)
            found[name] = said
        return found


def kinds_of(lake: Path) -> dict[str, list[Path]]:
    """The files of a lake, relative to it, by what they are."""
    found: dict[str, list[Path]] = defaultdict(list)
    for path in sorted(p.relative_to(lake) for p in lake.rglob("*") if p.is_file()):
        if path.name != ".lock" and path.parts[0] not in ("staging", "training"):
            found[path.parts[0]].append(path)
    return dict(found)


def damage(path: Path, what: str, draw: random.Random) -> str:
    """Damage a file in place; returns what was done."""
    data, entry = bytearray(path.read_bytes()), path.stat()
    if what == "loss" and draw.random() < 0.5:
        path.unlink()
        return "deleted"
    if what == "loss":
        length = draw.randrange(len(data))
        path.write_bytes(data[:length])
        return f"cut to {length} bytes"
    count = min(draw.randint(1, 64), len(data))
    start = draw.randrange(len(data) - count + 1)
    places: Sequence[int] = range(start, start + count)
    if draw.random() < 0.5:
        places = draw.sample(range(len(data)), count)
    for place in places:
        data[place] ^= draw.randint(1, 255)
    path.write_bytes(data)
    if draw.random() < 0.5:  # as a failing disk does, which tells nobody
        os.utime(path, ns=(entry.st_atime_ns, entry.st_mtime_ns))
        return f"{count} bytes flipped, date kept"
    return f"{count} bytes flipped"


TELLS: Final = ("has changed", "is missing", "is new")  # of settings: they may change, and it is said


def judge(
    lake: Path, file: Path, questions: Questions, right: Mapping[str, Said], sound: Mapping[str, str]
) -> dict[str, Any]:
    """What a damaged lake answers, whether the damage is found, and whether it is undone."""
    deep = command("verify", "--deep", "--json", "--lake", lake)
    found = questions.answers(lake)
    silent = [
        name
        for name, said in found.items()
        if said.status == 0 and said.out != right[name].out and not any(word in said.err for word in TELLS)
    ]
    tracebacks = {n: said.err[-400:] for n, said in found.items() if "Traceback" in said.err or "--debug" in said.err}
    run = None
    if "config" not in file.name:
        run = command("run", "all", "--lake", lake)
        if run.status == 0 and tables(lake) != sound:
            silent.append("run all")
    repaired = command("repair", "--json", "--lake", lake)
    after = command("verify", "--deep", "--lake", lake)
    return {
        "found": deep.status == 1 and file.as_posix() in deep.out,
        "silent": silent,
        "tracebacks": tracebacks,
        "told": sum(said.status != 0 for said in found.values()),
        "run": run.status if run else None,
        "repaired": repaired.status == 0 and after.status == 0 and tables(lake) == sound,
        "said": "" if repaired.status == 0 and after.status == 0 else repaired.out + repaired.err + after.out,
    }


def campaign(flips: int, losses: int, each: int, seed: int, folder: Path) -> dict[str, Any]:
    """Damage a lake again and again, always the sound one anew."""
    lake = make_lake(recordings(), folder, each)
    questions = Questions(lake, folder)
    right, sound = questions.answers(lake), tables(lake)
    for name, said in right.items():
        if said.status:
            sys.exit(f"{name}: {said.err}")
    control = judge(lake, Path("none"), questions, right, sound)
    kinds, draw = kinds_of(lake), random.Random(seed)
    order = [("flip", kind) for _, kind in zip(range(flips), _around(kinds), strict=False)]
    order += [("loss", kind) for _, kind in zip(range(losses), _around(kinds), strict=False)]
    tally: dict[str, Counter[str]] = defaultdict(Counter)
    wrong = []
    for number, (what, kind) in enumerate(order, 1):
        copy = folder / "damaged"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(lake, copy)
        file = draw.choice(kinds[kind])
        done = damage(copy / file, what, draw)
        result = judge(copy, file, questions, right, sound)
        good = result["found"] and result["repaired"] and not result["silent"] and not result["tracebacks"]
        tally[kind][what] += 1
        tally[kind]["as it should be"] += good
        if not good:
            wrong.append({"number": number, "file": file.as_posix(), "done": done, **result})
            print(json.dumps(wrong[-1])[:1500], flush=True)
        if number % 25 == 0:
            print(f"{number} of {len(order)}: {len(wrong)} not as they should be", flush=True)
    return {
        "flips": flips, "losses": losses, "seed": seed, "files": {kind: len(files) for kind, files in kinds.items()},
        "control": {"found": control["found"], "silent": control["silent"], "repaired": control["repaired"]},
        "by_kind": {kind: dict(counts) for kind, counts in tally.items()}, "wrong": wrong,
    }  # fmt: skip


def _around(kinds: Mapping[str, Sequence[Path]]) -> Any:
    while True:
        yield from kinds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flips", type=int, default=400)
    parser.add_argument("--losses", type=int, default=100)
    parser.add_argument("--each", type=int, default=6, help="clips of each of three sets")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures = campaign(given.flips, given.losses, given.each, given.seed, Path(folder))
        print(json.dumps({k: v for k, v in figures.items() if k != "wrong"}, indent=1), len(figures["wrong"]), "wrong")
        print(record("damage", figures, hash_files((Path(folder) / "src").rglob("*.*"), Path(folder))))


if __name__ == "__main__":
    main()

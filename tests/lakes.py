"""Small lakes for tests: source folders of real or made clips, runs of the command line, tables to compare."""

from __future__ import annotations

import atexit
import csv
import fcntl
import io
import json
import os
import shutil
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import astuple, dataclass
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import duckdb
import numpy as np
import pytest
from distributed import LocalCluster
from motionlake.cli.main import main
from motionlake.lake.catalog_file import announce_anew
from motionlake.lake.file_list import list_files, sums_of
from motionlake.lake.frames import read_part
from motionlake.lake.layout import Lake

from tests.processes import Started
from tests.samples import (
    KINECT_1,
    KINECT_1_PARENTS,
    deepmimic_frames,
    deepmimic_text,
    kinect_2_from_1,
    mirrored_body,
    npz_bytes,
    ntu_text,
    swinging_body,
)

QUICK = (
    '[postures]\ndictionary = "kmeans"\nm = 40\n'
    '[network]\nweights = "own"\nsteps = 20\nmax_words = 500\n'
    "[motifs]\nk = 12\n"
)
# Columns that tell time, or how often something was tried.
CLOCKS: Mapping[str, tuple[str, ...]] = {
    "manifest": ("seconds", "finished", "attempts"),
    "models": ("seconds", "created"),
    "files": ("mtime_ns",),
}
UNCOMPARED = ("runs",)


def made_once(folder: Path, make: Callable[[Path], object]) -> Path:
    """The folder, made by the first process of this run that asks for it, while others wait."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    done = folder.with_name(f"{folder.name}.done")
    with folder.with_name(f"{folder.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            make(folder)
            done.touch()
    return folder


def real_clips(recordings: Path, folder: Path, count: int) -> None:
    """The `count` smallest clips of each of three sets, with their labels and companions."""
    rows: list[dict[str, str]] = []
    for name, pattern in (("bandai1", "*.bvh"), ("hdm05", "*.amc"), ("utd_mhad", "*.npz")):
        base = recordings / name
        labels = {r["file"]: r for r in csv.DictReader((base / "labels.csv").open(encoding="utf-8"))}
        paths = sorted((base / "clips").rglob(pattern), key=lambda p: (p.stat().st_size, p.name))[:count]
        for path in paths:
            target = folder / name / path.relative_to(base / "clips")
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
            row = labels[path.relative_to(base).as_posix()]
            label = row.get("label") or row.get("content") or ""
            file = target.relative_to(folder).as_posix()
            rows.append({"file": file, "label": label, "subject": row.get("subject") or "", "note": name})
        for companion in (base / "clips").rglob("*.asf"):
            shutil.copyfile(companion, folder / name / companion.relative_to(base / "clips"))
    write_labels(folder / "labels.csv", rows)


def made_clips(folder: Path, count: int) -> None:
    """`count` made clips of each of three formats; those of the second are those of the first, left for right."""
    rows = []
    for i in range(count):
        body = swinging_body(40 + 7 * i)
        body[:, 5, 1] += 0.1 * np.sin(np.arange(len(body)) / (3 + i))
        contents: dict[str, bytes] = {
            f"kinect/a{i}.npz": npz_bytes(body, KINECT_1, KINECT_1_PARENTS, 30.0),
            f"ntu/b{i}.skeleton": ntu_text([(str(i), 0, kinect_2_from_1(mirrored_body(body)))]).encode(),
            f"deepmimic/c{i}.txt": deepmimic_text(deepmimic_frames(50 + 9 * i)).encode(),
        }
        for name, content in contents.items():
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
            rows.append({"file": name, "label": name[:3], "subject": str(i % 2), "note": "made"})
    write_labels(folder / "labels.csv", rows)


def write_labels(path: Path, rows: Sequence[Mapping[str, str]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as handle:
        writer = csv.DictWriter(handle, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


@dataclass(frozen=True)
class Run:
    """What one run of the command line came to."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


def finish(process: Started) -> Run:
    """Wait for a command to end."""
    process.wait(300)
    status = process.poll()
    assert status is not None
    run = Run(status, process.said("out"), process.said("err"))
    shutil.rmtree(process.folder)
    return run


def motionlake(*words: object) -> Run:
    """Run the command line within this process."""
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["motionlake", *map(str, words)]),
        redirect_stdout(out),
        redirect_stderr(err),
        pytest.raises(SystemExit) as stopped,
    ):
        main()
    return Run(int(stopped.value.code or 0), out.getvalue(), err.getvalue())


DISTRIBUTED = {"ingest", "run", "synthesize"}


def on_cluster(words: Sequence[object], scheduler: str) -> Run:
    """Run the command line within this process; what workers do, on a running cluster."""
    return motionlake(*words, *(["--scheduler", scheduler] if words[0] in DISTRIBUTED else []))


def elsewhere(site: Path, folder: Path, *lines: Sequence[str]) -> list[Run]:
    """Run command lines of the program that lies in `site`: in one new process, on one worker of its own."""
    program = f"""
import motionlake, tests.lakes
assert motionlake.__file__.startswith({str(site)!r}), motionlake.__file__
tests.lakes.run_and_tell({lines!r})
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=False, timeout=300,
        env=os.environ | {"PYTHONPATH": f"{site}{os.pathsep}{Path(__file__).parents[1]}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return [Run(*run) for run in json.loads(done.stdout)]


def run_and_tell(lines: Sequence[Sequence[str]]) -> None:
    """The other side of `elsewhere`."""
    with ExitStack() as stack:
        scheduler = ""
        if any(words[0] in DISTRIBUTED for words in lines):
            local = LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0")
            scheduler = stack.enter_context(local).scheduler_address
        print(json.dumps([astuple(on_cluster(words, scheduler)) for words in lines]))


def quick_lake(root: Path, config: str = QUICK) -> Path:
    """An empty lake whose models are fitted in a moment."""
    run = motionlake("init", root)
    assert run.status == 0, run.err
    (root / "config.toml").write_text(config, encoding="utf-8")
    return root


def ingested_lake(root: Path, clips: Path, scheduler: str) -> Path:
    """A lake of a folder of clips, with nothing made of them."""
    run = motionlake("ingest", clips, "--lake", root, "--scheduler", scheduler)
    assert run.status == 0, run.err
    return root


@cache
def plain_duckdb() -> duckdb.DuckDBPyConnection:
    """A DuckDB of this process: to start one takes seven times as long as to attach a catalog to it."""
    return duckdb.connect()


atexit.register(plain_duckdb.cache_clear)  # else DuckDB may tell of objects that are left


@contextmanager
def catalog(lake: Path) -> Iterator[duckdb.DuckDBPyConnection]:
    """The catalog in plain DuckDB, as any program may open it."""
    name = f"catalog_{uuid.uuid4().hex}"
    with plain_duckdb().cursor() as con:
        con.execute(f"ATTACH $catalog AS {name} (READ_ONLY)", {"catalog": str(lake / "catalog.duckdb")})
        try:
            con.execute(f"USE {name}")
            con.execute("SET file_search_path = $root", {"root": str(lake)})
            yield con
        finally:
            con.execute("USE memory")
            con.execute(f"DETACH {name}")


def query(lake: Path, text: str, **parameters: Any) -> list[tuple[Any, ...]]:
    with catalog(lake) as con:
        return con.execute(text, parameters).fetchall()


def tables(lake: Path) -> dict[str, list[str]]:
    """Every row of every table and view, sorted, without the columns that tell time."""
    with catalog(lake) as con:
        text = "SELECT table_name FROM information_schema.tables WHERE table_catalog = current_database()"
        names = [r[0] for r in con.execute(text).fetchall()]
        found = {}
        for name in sorted(set(names) - set(UNCOMPARED)):
            relation = con.table(name)
            columns = ", ".join(f'"{c}"' for c in relation.columns if c not in CLOCKS.get(name, ()))
            found[name] = sorted(map(repr, relation.project(columns).fetchall()))
        return found


def files(lake: Path) -> set[str]:
    """Every file of a lake but the lock and the catalogs that were kept."""
    found = {p.relative_to(lake).as_posix() for p in lake.rglob("*") if p.is_file() and p.name != ".lock"}
    return {file for file in found if not file.startswith("kept/")}


def assert_same(left: Mapping[str, list[str]], right: Mapping[str, list[str]]) -> None:
    """Fail with the first rows that differ."""
    assert left.keys() == right.keys()
    for name, rows in left.items():
        if rows != right[name]:
            only_left = sorted(set(rows) - set(right[name]))[:2]
            only_right = sorted(set(right[name]) - set(rows))[:2]
            raise AssertionError(f"{name}: {len(rows)} and {len(right[name])} rows; {only_left} {only_right}"[:1500])


def canonical_clips(lake: Path) -> list[tuple[str, float, np.ndarray, np.ndarray]]:
    """(clip, fps, positions, rotations) of every clip of a lake."""
    rates = dict(query(lake, "SELECT clip, fps FROM clips"))
    parts = sorted(lake.glob("frames/*/*.parquet"))
    return [
        (clip.clip, rates[clip.clip], clip.positions.astype(float), clip.rotations.astype(float))
        for part in parts
        for clip in read_part(part)
    ]


def list_anew(lake: Path) -> None:
    """Let the catalog list the parts and models of a lake as a test has made them."""
    folders = ("frames", "features", "embeddings", "moves", "postures", "graph", "shortlist", "models")
    found = (path for name in folders for path in lake.glob(f"{name}/**/*.*"))
    files = [path.relative_to(lake).as_posix() for path in found]
    with Changed(lake) as con:
        list_files(con.own, [sums_of(Lake(lake), file) for file in files if (lake / file).is_file()])


class Changed:
    """A connection that changes the catalog of a lake behind the program's back, and then lists it as written."""

    def __init__(self, lake: Path) -> None:
        self._lake, self.own = Lake(lake), duckdb.connect(str(lake / "catalog.duckdb"))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.own, name)

    def close(self) -> None:
        """End the change."""
        self.own.close()
        announce_anew(self._lake)

    def __enter__(self) -> Changed:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

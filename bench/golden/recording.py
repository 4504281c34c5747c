"""The golden record of lakes of real recordings."""

from __future__ import annotations

import csv
import json
import re
import shlex
import shutil
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

from bench.golden import commands, lakes
from bench.golden.contents import Clean, digest, lake_entries, without_clocks
from bench.golden.serve import Said, chain

WRITERS: Final = ("ingest", "run", "synthesize")
SMALL: Final = 20_000
MOMENT: Final = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(\.\d+)?( +\d+(\.\d+)?(?= ))?")


def record(recordings: Path) -> dict[str, Any]:
    """Make two lakes, ask them all there is to ask, and take down what they hold and say."""
    with tempfile.TemporaryDirectory(prefix="golden-") as folder:
        work = Path(folder).resolve()
        places = {name: str(work / name) for name in ("lake", "own", "src", "out")}
        copy_sources(recordings, work / "src")
        (work / "out").mkdir()
        clean = cleaner(work)
        found: dict[str, Any] = {}
        with ThreadPoolExecutor(2) as pool:
            own = pool.submit(_own_lake, work, places, clean)
            ready = pool.submit(_ready_lake, work, places, clean)
            found["ready"] = ready.result()
            asked = [
                pool.submit(chain, told(dict(half), places)) for half in _halves(commands.ASK | sql_commands(places))
            ]
            for half in asked:
                found.setdefault("asked", {}).update(answers(half.result(), clean))
            found |= own.result()
        found["asked"] = dict(sorted(found["asked"].items()))
        found["file"] = made_files(work / "out", clean)
        removed = chain(told(commands.REMOVE, places))
        found["removed"] = {"command": answers(removed, clean), **lake_entries(work / "lake", clean)}
        return found


def _ready_lake(work: Path, places: Mapping[str, str], clean: Clean) -> dict[str, Any]:
    configure(work / "lake", lakes.READY_CONFIG)
    said = chain(told(commands.BUILD | commands.UP_TO_DATE, places))
    return {"command": answers(said, clean), **lake_entries(work / "lake", clean)}


def _own_lake(work: Path, places: Mapping[str, str], clean: Clean) -> dict[str, Any]:
    found = {}
    steps = (("own", lakes.OWN_CONFIG, commands.OWN_BUILD), ("other", lakes.OTHER_CONFIG, commands.OTHER_BUILD))
    for name, config, build in steps:
        configure(work / "own", config)
        said = chain(told(build, places))
        found[name] = {"command": answers(said, clean), **lake_entries(work / "own", clean)}
    return found


def configure(lake: Path, config: str) -> None:
    """The folder of a lake that is to come, with its configuration."""
    lake.mkdir(exist_ok=True)
    (lake / "config.toml").write_text(config, encoding="utf-8")


def _halves(named: Mapping[str, str]) -> tuple[Iterable[tuple[str, str]], ...]:
    return list(named.items())[::2], list(named.items())[1::2]


def copy_sources(recordings: Path, target: Path) -> None:
    """The chosen recordings with their rows of labels.csv and segments.csv, one file cut off, one copied."""
    for name, files in lakes.SOURCES.items():
        for file in files:
            (target / name / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(recordings / name / file, target / name / file)
        for table in ("labels.csv", "segments.csv"):
            if (recordings / name / table).is_file():
                _reduce(recordings / name / table, target / name / table, frozenset(files))
    mixed = target / "mixed"
    mixed.mkdir()
    content = (recordings / lakes.COPIED).read_bytes()
    (mixed / "copy.bvh").write_bytes(content)
    (mixed / "cut_off.bvh").write_bytes(content[: lakes.CUT_OFF])


def _reduce(source: Path, target: Path, files: frozenset[str]) -> None:
    with source.open(encoding="utf-8", newline="") as handle, target.open("w", encoding="utf-8", newline="") as made:
        rows = csv.DictReader(handle)
        writer = csv.DictWriter(made, list(rows.fieldnames or ()))
        writer.writeheader()
        writer.writerows(row for row in rows if row["file"] in files)


def told(
    templates: Mapping[str, str],
    places: Mapping[str, str],
    clips: Mapping[str, str] = lakes.CLIPS,
    cluster: Sequence[str] = ("--workers", "1"),
) -> dict[str, list[str]]:
    """Templates as the words of commands; `cluster`: where shards run. Two lakes are made side by side."""
    found = {}
    for name, template in templates.items():
        words = [word.format(**places, **clips) for word in shlex.split(template)]
        if words[0] not in ("init", "rig") and "--lake" not in words:
            words += ["--lake", places["lake"]]
        if words[0] in WRITERS and "--classes" not in words:
            words += cluster
        found[name] = words
    return found


def sql_commands(places: Mapping[str, str]) -> dict[str, str]:
    """The queries as templates of commands."""
    return {f"sql {name}": shlex.join(["sql", query, "--json"]) for name, query in commands.SQL.items()}


def cleaner(work: Path) -> Clean:
    """Replaces the folder of one run in text, and moments with the seconds that may stand beside them."""
    return lambda text: MOMENT.sub("{time}", text.replace(str(work), "{work}"))


def answers(said: Mapping[str, Said], clean: Clean, left_out: Sequence[str] = commands.CLOCK_KEYS) -> dict[str, Any]:
    """What commands said, without what tells time; of long JSON its hash and its beginning."""
    return {name: _answer(each, clean, left_out) for name, each in said.items()}


def _answer(said: Said, clean: Clean, left_out: Sequence[str]) -> dict[str, Any]:
    found: dict[str, Any] = {"status": said.status}
    if said.status == 2:
        found["error"] = clean(said.err).strip().splitlines()[-1:]
    out = clean(said.out)
    try:
        value = without_clocks(json.loads(out), left_out)
    except ValueError:
        found["text"] = [" ".join(line.split()) for line in out.splitlines()]
        return found
    text = json.dumps(value, ensure_ascii=False)
    if len(text) <= SMALL:
        return {**found, "json": value}
    begins = value[:2] if isinstance(value, list) else {k: v for k, v in value.items() if len(json.dumps(v)) < 2_000}
    return {**found, "hash": digest(text.encode()), "length": len(value), "begins": begins}


def made_files(folder: Path, clean: Clean) -> dict[str, str]:
    """Hashes of the files that commands wrote."""
    found = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        content = path.read_bytes()
        if path.suffix not in (".png", ".gif"):
            content = clean(content.decode("utf-8")).encode()
        found[path.relative_to(folder).as_posix()] = digest(content)
    return found

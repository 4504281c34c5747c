"""Writers and readers on one lake at once: `python -m bench.many_at_once --seconds 600 --writers 4 --readers 8`.

Every writer takes in folders of its own, gives their clips other labels, takes clips out, and brings the lake up to
date; where another one writes it is refused by name, and tries something again. Every reader asks what no writer
changes, and gets the same answer each time; the default ways to search and find, which go along the neighbour graph of
the whole lake, answer each time with clips of the dataset that is asked, in order. In the end the lake holds every row
that was acknowledged, and no other.

With MOTIONLAKE_DATA the clips are the smallest of three sets of recordings, else made ones.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from bench.record import record
from tests.lakes import Run, finish, made_clips, query, quick_lake, real_clips, write_labels
from tests.processes import start

STAGES: Final = "all"
ASKED: Final = 2  # clips that readers ask about
FIRST: Final = 3  # answers to a question
BY_THE_LAKE: Final = ("search", "find")  # by default along the graph of all clips
BASE: Final = "base"  # the dataset that no writer changes
REFUSED: Final = "the lake is being written by "
CLIPS: Final = "SELECT clip, label FROM clips WHERE dataset != 'base'"
# What frames hold beside the clip's name, of every clip of some datasets.
FRAMES: Final = (
    "SELECT clip, count(*), sum(hash(COLUMNS(* EXCLUDE (clip, dataset)))) FROM frames GROUP BY clip ORDER BY clip"
)
_starting = threading.Lock()  # the process that commands are forked of serves one at a time


def run(*words: str | Path) -> Run:
    """A command as a process of its own."""
    with _starting:
        process = start(*words)
    return finish(process)


@dataclass
class Tally:
    """What all did, by what they did and what came of it, and every error."""

    counts: Counter[str] = field(default_factory=Counter)
    errors: list[str] = field(default_factory=list)

    def error(self, words: Sequence[object], what: str) -> None:
        line = f"{' '.join(map(str, words))}: {what}"
        print(f"ERROR {line}", flush=True)
        self.errors.append(line)


@dataclass
class Writer:
    """Writes until it is time, and knows which clips, of which labels, it was told are in the lake."""

    number: int
    lake: Path
    folder: Path
    clips: Sequence[Path]
    tally: Tally
    rng: random.Random
    made: int = 0
    acknowledged: dict[str, str] = field(default_factory=dict)  # a label by a clip
    origin: dict[str, Path] = field(default_factory=dict)  # what file a clip is a copy of

    def write(self, until: float) -> None:
        while time.monotonic() < until:
            self.rng.choice([self.take_in, self.take_in, self.relabel, self.take_out, self.bring_up_to_date])()

    def done(self, *words: str | Path) -> bool:
        """Run a command; whether it was done, and not refused."""
        found = run(*words, "--lake", self.lake)
        refused = found.status == 2 and REFUSED in found.err and found.err.count("\n") == 1
        self.tally.counts[f"{words[0]}: {'refused' if refused else 'done'}"] += 1
        if found.status != 0 and not refused:
            self.tally.error(words, f"status {found.status}: {found.err[-600:]}")
        return found.status == 0

    def take_in(self) -> None:
        """A folder of one or two clips and their labels."""
        self.made += 1
        dataset = f"w{self.number}-{self.made}"
        folder = self.folder / dataset
        for source in self.rng.sample(list(self.clips), min(2, len(self.clips))):
            folder.mkdir(exist_ok=True)
            shutil.copyfile(source, folder / source.name)
            self.origin[f"{dataset}/{source.name}"] = source
        self.label(dataset)

    def relabel(self) -> None:
        """Other labels for clips that are there."""
        if self.acknowledged:
            self.label(self.rng.choice(sorted(self.acknowledged)).partition("/")[0])

    def label(self, dataset: str) -> None:
        """Take a folder in with new labels, as soon as nobody else writes."""
        folder, label = self.folder / dataset, f"label {self.rng.random()}"
        names = sorted(p.name for p in folder.iterdir() if p.name != "labels.csv")
        write_labels(folder / "labels.csv", [{"file": name, "label": label} for name in names])
        while not self.done("ingest", folder, "--workers", "1"):
            time.sleep(self.rng.uniform(0.05, 0.5))
        self.acknowledged |= {f"{dataset}/{name}": label for name in names}

    def take_out(self) -> None:
        """A clip, with its file."""
        if not self.acknowledged:
            return
        clip = self.rng.choice(sorted(self.acknowledged))
        dataset, _, name = clip.partition("/")
        if len([c for c in self.acknowledged if c.startswith(f"{dataset}/")]) > 1 and self.done("remove", clip):
            del self.acknowledged[clip]
            (self.folder / dataset / name).unlink()

    def bring_up_to_date(self) -> None:
        self.done("run", STAGES, "--workers", "1")


@dataclass
class Reader:
    """Asks until it is time; answers must be what they were at first, or in order where the whole lake has a say."""

    lake: Path
    answers: Sequence[tuple[Sequence[str | Path], str]]
    tally: Tally
    rng: random.Random

    def read(self, until: float) -> None:
        while time.monotonic() < until:
            words, expected = self.rng.choice(list(self.answers))
            found = run(*words, "--lake", self.lake)
            self.tally.counts[f"{words[0]}: {'answered' if found.status == 0 else 'failed'}"] += 1
            right = (
                in_order(found.out) if words[0] in BY_THE_LAKE and "--method" not in words else found.out == expected
            )
            if found.status or not right:
                self.tally.error(words, f"status {found.status}: {found.err[-400:]} {found.out[-200:]}")


def in_order(answer: str) -> bool:
    """Whether an answer to a search is of `FIRST` hits of the dataset that was asked, the nearest first."""
    try:
        rows = json.loads(answer)
    except ValueError:
        return False
    distances = [row["distance"] for row in rows]
    places = {(row["clip"], row.get("start")) for row in rows}
    of_base = all(row["dataset"] == BASE for row in rows)
    return len(places) == len(rows) == FIRST and of_base and distances == sorted(distances)


def questions(clip: str) -> list[list[str]]:
    """Of a clip, to the dataset that nobody changes."""
    return [
        ["search", clip, "-k", str(FIRST), "--dataset", BASE, "--json"],
        ["search", clip, "-k", str(FIRST), "--dataset", BASE, "--method", "signature", "--json"],
        ["search", clip, "-k", str(FIRST), "--dataset", BASE, "--method", "moves", "--json"],
        ["find", clip, "--from", "0", "--to", "30", "-k", str(FIRST), "--dataset", BASE, "--json"],
        ["find", clip, "--from", "0", "--to", "30", "-k", str(FIRST), "--dataset", BASE, "--method", "words", "--json"],
        ["align", clip, "--whole", "-k", str(FIRST), "--dataset", BASE, "--json"],
        ["sql", f"SELECT count(*), sum(hash(frames)) FROM frames WHERE dataset = '{BASE}'", "--json"],
        ["sql", f"SELECT count(*) FROM embeddings WHERE clip LIKE '{BASE}/%'", "--json"],
        ["sql", "SELECT count(*) FROM (FROM frames ANTI JOIN clips USING (clip))", "--json"],
        ["export", clip, "--rig", "canonical", "-o", "/dev/null"],
        ["duplicates", "--dataset", BASE, "--json"],
    ]


def check(lake: Path, writers: Sequence[Writer], base: dict[str, tuple[Any, ...]], tally: Tally) -> int:
    """Compare what the lake holds with what was acknowledged; how many clips that is."""
    expected = {clip: label for writer in writers for clip, label in writer.acknowledged.items()}
    found = dict(query(lake, CLIPS))
    for clip in sorted(expected.keys() | found.keys()):
        if found.get(clip) != expected.get(clip):
            tally.error(["row of", clip], f"is {found.get(clip)}, and {expected.get(clip)} was acknowledged")
    origin = {clip: source for writer in writers for clip, source in writer.origin.items()}
    for clip, *values in query(lake, FRAMES):
        source = origin.get(clip)
        same = base[clip if source is None else f"{BASE}/{source.name}"]
        if tuple(values) != same:
            tally.error(["frames of", clip], "are not those of its file")
    return len(expected)


def together(works: Sequence[Callable[[float], None]], seconds: float) -> None:
    until = time.monotonic() + seconds
    threads = [threading.Thread(target=work, args=(until,)) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def measure(seconds: float, writers: int, readers: int, seed: int, clips: int) -> dict[str, Any]:
    """All of it."""
    tally, data = Tally(), os.environ.get("MOTIONLAKE_DATA")
    with tempfile.TemporaryDirectory(prefix="bench-many-") as name:
        folder = Path(name)
        real_clips(Path(data), folder / "all", clips) if data else made_clips(folder / "all", clips)
        (folder / BASE).mkdir()
        for path in (p for p in (folder / "all").rglob("*") if p.suffix in (".npz", ".bvh", ".skeleton", ".txt")):
            shutil.copyfile(path, folder / BASE / path.name)
        lake = quick_lake(folder / "lake")
        for words in (["ingest", folder / BASE], ["run", STAGES]):
            made = run(*words, "--workers", "2", "--lake", lake)
            if made.status:
                raise RuntimeError(made.err)
        base = {clip: tuple(values) for clip, *values in query(lake, FRAMES)}
        asked = [words for clip in sorted(base)[:ASKED] for words in questions(clip)]
        answers = [(words, first.out) for words in asked if (first := run(*words, "--lake", lake)).status == 0]
        every = sorted((folder / BASE).iterdir())
        writing = [Writer(i, lake, folder, every, tally, random.Random(f"{seed} {i}")) for i in range(writers)]
        reading = [Reader(lake, answers, tally, random.Random(f"{seed} r{i}")) for i in range(readers)]
        together([*(w.write for w in writing), *(r.read for r in reading)], seconds)
        for words in (["run", STAGES], ["run", STAGES]):
            last = run(*words, "--workers", "2", "--lake", lake)
        if last.status:
            tally.error(words, last.err)
        held = check(lake, writing, base, tally)
        kept = {row[0] for row in query(lake, "SELECT unnest(files) FROM manifest UNION SELECT file FROM models")}
        left = [p for f in ("frames", "raw", "features") for p in (lake / f).rglob("*.[pa]*")]
        if stray := [p.name for p in left if p.relative_to(lake).as_posix() not in kept]:
            tally.error(["the lake"], f"keeps {len(stray)} parts that no catalog names")
    return {
        "seed": seed, "seconds": seconds, "writers": writers, "readers": readers, "questions": len(answers),
        "counts": dict(sorted(tally.counts.items())), "acknowledged_clips": held, "errors": tally.errors,
        "clips": "recordings" if data else "made",
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description="Write to and read from one lake at once.")
    parser.add_argument("--seconds", type=float, default=600)
    parser.add_argument("--writers", type=int, default=4)
    parser.add_argument("--readers", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--clips", type=int, default=4, help="of each of three formats")
    given = parser.parse_args()
    figures = measure(given.seconds, given.writers, given.readers, given.seed, given.clips)
    print(", ".join(f"{name} {count}" for name, count in figures["counts"].items()))
    print(f"{figures['acknowledged_clips']} clips acknowledged and there; {len(figures['errors'])} errors")
    print(record("many-at-once", figures))
    if figures["errors"]:
        sys.exit(1)


if __name__ == "__main__":
    main()

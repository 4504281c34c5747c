"""Ranges of clips as queries, beside files that hold their frames alone: `python -m bench.pesta.cut_files [SET ...]`.

Each CMU set is a lake with the default configuration. Windows of a second, `WINDOWS` a set, are drawn with seed 0, each
frame of a set as likely as any to begin one. A window is asked for as a range of its clip, and as a file of its frames
in the format of its clip. Of the file the string is also made here, from the codes of its postures, by a reduction that
shares nothing with the package's.

- `identical`: the string of the range is that one; `identical_files`: that of the file is. Windows of one symbol count.
- `refused`: the range is answered with an error; `held`: the file's string is one symbol.
- `hits`: of the first ten answers to the range, its own frames among them, those that have the same clip as the answer
  to the file with the same rank, and at least .9 of the frames of both in common. `windows`: those in which all do.
- `before_...`: what the string of the whole clip, cut, would make of it, as was done until November 2026; `lacking`: it
  lacks a symbol of the file's.
- `found`: the range is an answer to itself, at least half of the frames of both in common.
- `cases`: 13_29, frames 240 to 360 and 180 to 420, `hits` and `before`, the seconds of the first answers to each.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.errors import UserError
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.motion.features import word_features
from motionlake.retrieval.alignment import AlignmentRangeSearcher
from motionlake.retrieval.encode import query_motion
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.string_queries import StringQuery

from bench.lakes import make_lake
from bench.pesta.sets import hash_sets
from bench.record import record, recordings

SETS: Final = ("cmu_bvh", "cmu_dance", "cmu_exercises", "cmu_86")
WINDOWS: Final = 500
SECONDS: Final = 1.0
ALIKE: Final = 0.9  # of the frames of two answers, in common
FIRST: Final = 10
OWN: Final = Scope(own=True)
CASES: Final = ((240, 360), (180, 420))


@dataclass(frozen=True)
class Window:
    clip: str
    source: Path
    start: int
    stop: int


def reduced(codes: Sequence[int]) -> list[int]:
    """The string of codes, step by step as `motionlake.pesta.tandem` says it, by trying everything."""
    word = [code for i, code in enumerate(codes) if i == 0 or code != codes[i - 1]]
    found: list[tuple[int, int, int]] = []
    for period in range(1, len(word) // 2 + 1):
        for start in range(len(word) - 2 * period + 1):
            stop = start + period
            while stop < len(word) and word[stop] == word[stop - period]:
                stop += 1
            goes_left = start > 0 and word[start - 1] == word[start - 1 + period]
            smaller = any((a, b) == (start, stop) for _, a, b in found)
            if stop - start >= 2 * period and not goes_left and not smaller:
                found.append((period, start, stop))
    used, gone = set[int](), set[int]()
    for period, start, stop in sorted(found):
        if used.isdisjoint(range(start, stop)):
            used.update(range(start, stop))
            gone.update(range(start + period, stop - (stop - start) % period))
    kept: list[int] = []
    for symbol in (code for i, code in enumerate(word) if i not in gone):
        kept.append(symbol)
        for half in range(1, len(kept) // 2 + 1):
            if kept[-half:] == kept[-2 * half : -half]:
                del kept[-half:]
                break
    return kept


def cut_file(source: Path, start: int, stop: int, folder: Path) -> Path:
    """A file of frames [start, stop) of a BVH or AMC file, beside the skeletons it needs."""
    lines, name = source.read_text(encoding="utf-8", errors="replace").splitlines(), folder / source.name
    if source.suffix == ".bvh":
        at = next(i for i, line in enumerate(lines) if line.strip().startswith("Frames:"))
        text = [*lines[:at], f"Frames: {stop - start}", lines[at + 1], *lines[at + 2 + start : at + 2 + stop]]
    else:
        numbers = [i for i, line in enumerate(lines) if line.strip().isdigit()] + [len(lines)]
        text = lines[: numbers[0]]
        for number, frame in enumerate(range(start, stop), start=1):
            text += [str(number), *lines[numbers[frame] + 1 : numbers[frame + 1]]]
        for skeleton in source.parent.glob("*.asf"):
            shutil.copyfile(skeleton, folder / skeleton.name)
    name.write_text("\n".join(text) + "\n", encoding="utf-8")
    return name


def drawn(searcher: AlignmentRangeSearcher, source: Path, count: int) -> Iterator[Window]:
    """Windows of the clips of one set."""
    rng, clips = np.random.default_rng(0), searcher.strings.clips
    lengths = np.array([round(SECONDS * clip.fps) for clip in clips])
    room = np.maximum(0, np.array([clip.frames for clip in clips]) - lengths + 1)
    for place in rng.integers(0, room.sum(), count).tolist():
        clip = int(np.searchsorted(np.cumsum(room), place, side="right"))
        start = place - int(room[:clip].sum())
        name = clips[clip].clip
        yield Window(name, source / name.partition("/")[2], start, start + int(lengths[clip]))


class Recording(AlignmentRangeSearcher):
    """Keeps the string of the last query."""

    last: StringQuery | None = None

    def symbols_of(self, query: Query, *, mirrored: bool = False) -> StringQuery:
        self.last = None
        self.last = super().symbols_of(query, mirrored=mirrored)
        return self.last


def common(one: Hit, other: Hit) -> float:
    """Of the frames of two answers, the share that both have."""
    if one.clip != other.clip:
        return 0.0
    starts, stops = [hit.start or 0 for hit in (one, other)], [hit.stop or 0 for hit in (one, other)]
    return max(0, min(stops) - max(starts)) / (max(stops) - min(starts))


def asked(searcher: Recording, query: Query) -> tuple[list[int] | None, list[Hit]]:
    """The string of a query, None where it is refused, and the first answers."""
    try:
        (hits,) = searcher.search([query], FIRST, OWN)
    except UserError:
        return None, []
    assert searcher.last is not None
    return searcher.last.symbols.tolist(), hits


def before(searcher: AlignmentRangeSearcher, clip: str, start: int, stop: int) -> list[int]:
    """The string of the whole clip, cut."""
    string = searcher.strings.string_of(searcher.strings.positions[clip])
    return string.symbols[(string.starts < stop) & (string.stops > start)].tolist()  # type: ignore[no-any-return]


def measure(lake: Lake, source: Path, windows: int) -> dict[str, Any]:
    """The figures of one set."""
    searcher = Recording(lake)
    dictionary = searcher.clip_strings.dictionary
    counts = dict.fromkeys(
        ("identical", "identical_files", "refused", "held", "before_refused", "before_lacking", "found", "windows"), 0
    )
    alike = every = 0
    rows, features = [], []
    with tempfile.TemporaryDirectory() as folder:
        for window in drawn(searcher, source, windows):
            file = cut_file(window.source, window.start, window.stop, Path(folder))
            motion = query_motion(lake, Query(file))
            features.append(word_features(*motion.cut(), motion.fps, dictionary.config.frames))
            of_range = asked(searcher, Query(window.clip, window.start, window.stop))
            rows.append((window, of_range, asked(searcher, Query(file))))
    codes = np.split(dictionary.encode(np.concatenate(features)), np.cumsum([len(own) for own in features])[:-1])
    for (window, (string, hits), (of_file, others)), own in zip(rows, codes, strict=True):
        expected, old = reduced(own.tolist()), before(searcher, window.clip, window.start, window.stop)
        held = len(expected) < 2
        counts["held"] += held
        counts["refused"] += string is None
        counts["identical"] += string == (None if held else expected)
        counts["identical_files"] += of_file == (None if held else expected)
        counts["before_refused"] += len(old) < 2 and not held
        counts["before_lacking"] += not set(expected) <= set(old)
        pairs = [common(hit, other) >= ALIKE for hit, other in zip(hits, others, strict=False)]
        pairs += [False] * abs(len(hits) - len(others))
        alike, every = alike + sum(pairs), every + len(pairs)
        counts["windows"] += all(pairs)
        counts["found"] += any(
            common(hit, Hit(rank=0, clip=window.clip, start=window.start, stop=window.stop, distance=0.0, label=None,
                            dataset="", seconds=0.0)) >= 0.5 for hit in hits
        )  # fmt: skip
    shares = {name: count / windows for name, count in counts.items()}
    return {**shares, "hits": alike / every, "n": windows, "n_hits": every, "model": served_config(lake).postures.m}


def cases(lake: Lake) -> dict[str, Any]:
    """13_29, as the range is asked for now and as it was."""
    searcher = Recording(lake)
    found = {}
    for start, stop in CASES:
        clip = next(c.clip for c in searcher.strings.clips if "13_29" in c.clip)
        (hits,) = searcher.search([Query(clip, start, stop)], FIRST)
        old = before(searcher, clip, start, stop)
        olds = searcher.in_symbols(np.array(old, dtype=np.int32), FIRST) if len(old) > 1 else []
        found[f"{start} to {stop}"] = {
            "hits": [(hit.clip, hit.start, hit.seconds, hit.cost, hit.cycles, hit.speed) for hit in hits],
            "before": [(hit.clip, hit.start, hit.seconds, hit.cost) for hit in olds],
        }
    return found


def prepared(folder: Path, source: Path) -> Lake:
    """A lake of one set with its strings."""
    folder.mkdir(parents=True, exist_ok=True)
    lake = make_lake(folder, [source])
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, ("postures", "symbols"))
    return lake


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "sets", nargs="*", default=list(SETS), metavar="SET", help=f"of {', '.join(SETS)} (default: all)"
    )
    parser.add_argument("--windows", type=int, default=WINDOWS)
    given = parser.parse_args()
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in given.sets:
            source = recordings() / name
            lake = prepared(Path(folder) / name, source)
            figures[name] = measure(lake, source, given.windows)
            print(name, {key: round(value, 4) for key, value in figures[name].items()}, flush=True)
            if name == "cmu_exercises":
                figures["cases"] = cases(lake)
                for case, rows in figures["cases"].items():
                    print(f"13_29, {case}:", *(f"\n  {row}" for kind in rows for row in [kind, *rows[kind]]))
    print(record("pesta-cut-files", figures, hash_sets(given.sets)))


if __name__ == "__main__":
    main()

"""Lakes of any number of clips: real recordings cut to random ranges and warped in time.

A small lake of the recordings is made by the commands' own stages. The clips of the large one are cut out of its
frames, and the kernels of the stages make words, motifs, symbol strings and joints of them; their rows enter the
catalog by the statements of the stages, with the keys that the stages ask for. Frames are not written: nothing that is
measured reads them, and to ingest so many files would take hours.
"""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.arrays import Float32Array, Float64Array, Int32Array
from motionlake.deep_motifs.motifs import assign
from motionlake.deep_motifs.words.network import load_network
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.catalog import Connection, create_catalog, fetch, reading, run_sql, writing
from motionlake.lake.file_list import list_files, sums_of
from motionlake.lake.frames import Frames, read_part
from motionlake.lake.layout import Lake
from motionlake.lake.parts import write_part
from motionlake.lake.settings import served_config
from motionlake.motion.features import word_features, word_windows
from motionlake.motion.resampling import interpolated
from motionlake.pesta.dictionary import load_dictionary
from motionlake.pesta.symbols import symbolise
from motionlake.stages import moves, symbols
from motionlake.stages.mapped_part import lists_of, write_mapped
from motionlake.stages.motif_model import read_motifs
from motionlake.stages.moves import MOVES, joints_of
from motionlake.stages.reader import LakeReader
from motionlake.stages.signatures import SIGNATURES
from motionlake.stages.stage import PartStage
from motionlake.stages.symbols import SYMBOLS

from bench.lakes import make_lake

SETS: Final = ("hdm05", "bandai1", "cmu_dance", "utd_mhad")
STAGES: Final = ("words", "embed", "motifs", "signatures", "postures", "symbols", "moves")
SECONDS: Final = (1.0, 4.0)  # that a clip lasts before it is warped
PACES: Final = (0.75, 1.33)  # at which it goes on at some places
KNOTS: Final = 5  # places
FPS: Final = 30.0
PART: Final = 1000  # clips
TOGETHER: Final = 50  # clips that a network sees at once: each word and posture by itself, as in the stages
DATASET: Final = "cut"
# What the catalog says of a clip is what it says of the recording that it was cut from.
CLIPS: Final = """
INSERT INTO clips BY NAME
SELECT c.* EXCLUDE (clip, dataset, path, frames, fps, seconds, content_hash, part), r.clip, $dataset AS dataset,
    r.clip AS path, r.frames, $fps::DOUBLE AS fps, r.frames / $fps::DOUBLE AS seconds, md5(r.clip) AS content_hash,
    r.part
FROM rows r JOIN base.clips c ON c.clip = r.source ORDER BY r.clip
"""
SHARDS: Final = """
INSERT INTO manifest BY NAME
SELECT r.stage, r.key, r.part, $dataset AS dataset, 'ok' AS state, 1 AS attempts, r.rows, 0 AS bytes, '{}' AS spec,
    r.files FROM rows r
"""
MODELS: Final = """
INSERT INTO models FROM base.models;
INSERT INTO motifs FROM base.motifs;
INSERT INTO postures FROM base.postures;
"""


def large_lake(folder: Path, data: Path, clips: int, seed: int = 0, processes: int = 2) -> Lake:
    """A lake of so many clips with all that the default search reads but the stages that follow whole lakes."""
    small = small_lake(folder / "recordings", data)
    lake = Lake(folder / "lake")
    create_catalog(lake)
    shutil.copytree(small.root / "models", lake.root / "models")
    if small.config_file.is_file():
        shutil.copy(small.config_file, lake.config_file)
    (lake.root / "made").mkdir()
    parts = [(str(small.root), str(lake.root), part, seed, min(PART, clips - part * PART))
             for part in range(-(-clips // PART))]  # fmt: skip
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        for part in pool.map(_make_part, parts):
            print(f"part {part + 1} of {len(parts)}", end="\r", flush=True)
    _load(small, lake, [_name(part) for _, _, part, _, _ in parts])
    shutil.rmtree(lake.root / "made")
    return lake


def small_lake(folder: Path, data: Path) -> Lake:
    """The recordings themselves, made by the stages."""
    lake = make_lake(folder, [data / name for name in SETS])
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, STAGES)
    return lake


def _name(part: int) -> str:
    return f"cut-{part:05}"


@dataclass(frozen=True)
class _Cut:
    """A clip cut out of a recording and warped."""

    clip: str
    source: str
    positions: Float64Array
    rotations: Float64Array


@cache
def _recordings(root: str) -> list[list[Frames]]:
    """Clips of each set."""
    lake = Lake(Path(root))
    return [[clip for part in sorted(folder.glob("*.parquet")) for clip in read_part(part)]
            for folder in sorted(lake.root.glob("frames/*"))]  # fmt: skip


def cuts(root: str, part: int, seed: int, count: int) -> Iterator[_Cut]:
    """The clips of a part: of each set in turn, and of its frames each as likely as any other."""
    rng, sets = np.random.default_rng((seed, part)), _recordings(root)
    shares = [np.array([len(clip.positions) / clip.fps for clip in clips]) for clips in sets]
    for number in range(count):
        clips, share = sets[number % len(sets)], shares[number % len(sets)]
        source = clips[int(rng.choice(len(clips), p=share / share.sum()))]
        seconds = min(rng.uniform(*SECONDS), (len(source.positions) - 1) / source.fps)
        start = rng.uniform(0, (len(source.positions) - 1) / source.fps - seconds)
        at = (start + _warped(rng, seconds)) * source.fps
        rotations = interpolated(source.rotations.astype(float), at)
        rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
        clip = f"{DATASET}/{part:05}/{number:04}.bvh"
        yield _Cut(clip, source.clip, interpolated(source.positions.astype(float), at), rotations)


def _warped(rng: np.random.Generator, seconds: float) -> Float64Array:
    """[F] the instants of so many seconds at which frames are taken, faster here and slower there."""
    paces = np.interp(np.linspace(0, KNOTS - 1, 64), np.arange(KNOTS), rng.uniform(*PACES, KNOTS))
    course = np.concatenate([[0], np.cumsum(paces)])
    frames = max(8, round(seconds / paces.mean() * FPS))
    return np.asarray(
        np.interp(np.linspace(0, 1, frames), np.linspace(0, 1, len(course)), course) / course[-1] * seconds
    )


def _make_part(of: tuple[str, str, int, int, int]) -> int:
    """What the stages would make of the clips of one part, into the folder `made` of the lake."""
    root, target, part, seed, count = of
    small, lake = Lake(Path(root)), Lake(Path(target))
    made, clips = _Made(small), cuts(root, part, seed, count)
    for some in iter(lambda: list(itertools.islice(clips, TOGETHER)), []):
        made.add(some)
    for name, table in made.tables(_name(part)).items():
        write_part(lake.root / "made" / f"{_name(part)}-{name}.parquet", table, {})
    return part


class _Made:
    """What stages make of clips, row by row."""

    def __init__(self, small: Lake) -> None:
        with reading(small) as con:
            files = {
                kind: small.path(file)
                for kind, file in con.execute('SELECT kind, file FROM models WHERE "current"').fetchall()
            }
        self._config = served_config(small)
        self._network, self._motifs = load_network(files["network"]), read_motifs(files["motifs"])
        self._dictionary = load_dictionary(files["postures"])
        self._clips: list[tuple[str, str, int]] = []
        self._words: list[Int32Array] = []
        self._strings: list[Any] = []
        self._joints: list[Float32Array] = []

    def add(self, clips: Sequence[_Cut]) -> None:
        words, coding = self._config.words, self._dictionary.config
        windows = [word_windows(word_features(c.positions, c.rotations, FPS, words), words) for c in clips]
        found = assign(self._network.embed(np.concatenate(windows)), self._motifs)
        self._words += np.split(found, np.cumsum([len(each) for each in windows])[:-1])
        postures = [word_features(c.positions, c.rotations, FPS, coding.frames) for c in clips]
        codes = np.split(
            self._dictionary.encode(np.concatenate(postures)), np.cumsum([len(each) for each in postures])[:-1]
        )
        for clip, own in zip(clips, codes, strict=True):
            count = len(clip.positions)
            self._clips.append((clip.clip, clip.source, count))
            self._strings.append(
                symbolise(own, codes_fps=coding.fps, fps=FPS, n_frames=count, config=self._config.symbols)
            )
            self._joints.append(joints_of(clip.positions, FPS))

    def tables(self, part: str) -> Mapping[str, pa.Table]:
        names = [clip for clip, _, _ in self._clips]
        motifs = [pa.array(names).take(pa.array(np.repeat(np.arange(len(names)), [len(w) for w in self._words]))),
                  np.concatenate([np.arange(len(w), dtype=np.int32) for w in self._words]),
                  np.concatenate(self._words)]  # fmt: skip
        rows = np.repeat(np.arange(len(names)), [len(each) for each in self._joints])
        clips = pa.array(names).take(pa.array(rows))
        return {
            "clips": pa.table({"clip": names, "source": [s for _, s, _ in self._clips],
                               "frames": [n for _, _, n in self._clips], "part": [part] * len(names)}),
            "motifs": pa.table({"clip": motifs[0], "word": motifs[1], "motif": pa.array(motifs[2], pa.int32()),
                                "part": pa.repeat(part, len(motifs[1]))}),
            "strings": symbols.string_rows(names, self._strings, part),
            "moves": pa.table({"clip": clips, moves.JOINTS: lists_of(np.concatenate(self._joints))}),
        }  # fmt: skip


def _load(small: Lake, lake: Lake, parts: Sequence[str]) -> None:
    """Enter all of it, as the stages that made it would."""
    with writing(lake) as con:
        con.execute("ATTACH $catalog AS base (READ_ONLY)", {"catalog": str(small.catalog)})
        con.execute(MODELS)
        _enter(con, CLIPS, _all(lake, parts, "clips"), fps=FPS)
        _enter(con, SHARDS, _shards("frames", [(part, f"frames-{part}", []) for part in parts]))
        own = {"parts": parts, "model": "", "motifs": ""}
        run_sql(con, "load_word_motifs", {**own, "files": _files(lake, parts, "motifs")})
        run_sql(con, "make_signatures", own)
        run_sql(con, "load_symbols", {**own, "files": _files(lake, parts, "strings")})
        _list(con, lake)
    with writing(lake) as con:
        con.execute("DETACH base")  # all connections of a process share what is attached
        at = LakeReader(con, lake, served_config(lake))
        for stage in (MOVES, SIGNATURES, SYMBOLS):
            _enter(con, SHARDS, _made_by(stage, at, lake))
        _list(con, lake)


def _list(con: Connection, lake: Lake) -> None:
    list_files(con, [sums_of(lake, row["file"]) for row in fetch(con, "unlisted_files")])


def _made_by(stage: PartStage, at: LakeReader, lake: Lake) -> pa.Table:
    made = []
    for part in stage.parts(at) or []:
        if stage is MOVES:
            table = pq.read_table(lake.root / "made" / f"{part.part}-moves.parquet")
            write_mapped(lake.path(MOVES.file(part.key)), table, part.key)
        made.append((part.part, part.key, [MOVES.file(part.key)] if stage is MOVES else []))
    return _shards(stage.name, made)


def _shards(stage: str, made: Sequence[tuple[str, str, list[str]]]) -> pa.Table:
    return pa.table({"stage": [stage] * len(made), "part": [part for part, _, _ in made],
                     "key": [key for _, key, _ in made], "rows": [0] * len(made),
                     "files": pa.array([files for _, _, files in made], pa.list_(pa.string()))})  # fmt: skip


def _enter(con: Connection, text: str, rows: pa.Table, **more: Any) -> None:
    con.register("rows", rows)
    con.execute(text, {"dataset": DATASET, **more})
    con.unregister("rows")


def _files(lake: Lake, parts: Sequence[str], name: str) -> list[str]:
    return [str(lake.root / "made" / f"{part}-{name}.parquet") for part in parts]


def _all(lake: Lake, parts: Sequence[str], name: str) -> pa.Table:
    return pa.concat_tables([pq.read_table(file) for file in _files(lake, parts, name)])

"""Stage "transitions": candidate transitions between the clips of a dataset, and how far their contexts are apart.

A shard compares the clips of two frames parts. It depends on the frames alone, so new motifs cost no
comparison again. One more shard a dataset, kept as "contexts", picks the nearest candidates of each word, compares
the signatures around their ends and replaces the dataset's rows of the table `transitions`.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations_with_replacement, groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
from motionlake.columns import numbers
from motionlake.deep_motifs.config import TransitionsConfig
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, fetch, fetch_table, load_rows
from motionlake.lake.config import config_hash
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.parts import write_part
from motionlake.motion.features import WordConfig, body_length, windows
from motionlake.motion.resampling import resample
from motionlake.stages.motif_model import MOTIF_MODEL
from motionlake.stages.reader import LakeReader
from motionlake.stages.signatures import SIGNATURES
from motionlake.stages.stage import Part, Shard, ShardResult, ShardStage, clips_of, frames_parts
from numpy.typing import NDArray

if TYPE_CHECKING:
    from motionlake.deep_motifs.motion_graph.transitions import Windowed

CONTEXTS = "contexts"
ROWS = pa.schema(
    [
        ("from_clip", pa.string()), ("from_frame", pa.int64()), ("from_word", pa.int32()),
        ("to_clip", pa.string()), ("to_frame", pa.int64()), ("to_word", pa.int32()), ("distance", pa.float64()),
    ]
)  # fmt: skip


class Transitions(ShardStage):
    """Where clips of one dataset can be joined into motion graphs.

    The table `transitions` is filled by the shards of contexts, which are planned once all pairs of a dataset's parts
    are compared.
    """

    name = "transitions"
    version = 2  # without calibration poses
    upstream = ("frames", "signatures")
    about = "where clips of DATASET=name (all datasets) can be joined into motion graphs"
    tables = ("transitions",)
    folders = ("transitions",)
    by_name = True

    def plan(self, at: LakeReader) -> list[Shard]:
        return [shard for parts in _parts_of_datasets(at.con).values() for shard in self._plan(at, parts)]

    def _plan(self, at: LakeReader, parts: Sequence[Part]) -> list[Shard]:
        """The pairs of parts of a dataset that are not compared yet, or else the contexts of what was found."""
        every = self._pairs(at, parts)
        return [s for s in every if s.key not in at.done(self.name)] or self._contexts(at, parts, every)

    def _pairs(self, at: LakeReader, parts: Sequence[Part]) -> list[Shard]:
        """A shard for every pair of parts of one dataset, done or not."""
        words, config = at.config.words, at.config.transitions
        shaping = asdict(config) | {"fps": words.fps, "length": words.length, "stride": words.stride}
        del shaping["context"]  # compared anew without comparing frames
        clips = {p.part: clips_of(at.con, p.part) for p in parts}
        shards = []
        for a, b in combinations_with_replacement(parts, 2):
            spec = {
                "parts": [a.part, b.part],
                "clips": clips[a.part] + (clips[b.part] if b is not a else []),
                "words": asdict(words),
                "transitions": asdict(config),
            }
            key = config_hash(self.name, self.version, a.key, b.key, shaping)
            shards.append(Shard(self.name, key, f"{a.part}+{b.part}", a.dataset, spec, a.clips))
        return shards

    def _contexts(self, at: LakeReader, parts: Sequence[Part], pairs: Sequence[Shard]) -> list[Shard]:
        signed = {p.part: p.key for p in SIGNATURES.parts(at) or []}
        if not signed:
            return []
        keys = [signed[p.part] for p in parts]
        key = config_hash(CONTEXTS, self.version, [s.key for s in pairs], keys, at.config.transitions)
        if key in at.done(CONTEXTS) or not at.done(SIGNATURES.name).issuperset(keys):
            return []
        spec = {"files": [candidates_file(s.key) for s in pairs], "transitions": asdict(at.config.transitions)}
        dataset = parts[0].dataset
        return [Shard(CONTEXTS, key, dataset, dataset, spec, sum(p.clips for p in parts))]

    def due(self, at: LakeReader) -> int:
        """Shards due in the datasets whose transitions were ever made; contexts only where no pair is."""
        made = {r["dataset"] for r in fetch(at.con, "shards", {"stage": self.name})}
        datasets = _parts_of_datasets(at.con)
        return sum(len(self._plan(at, parts)) for name, parts in datasets.items() if name in made)

    def lacking(self, at: LakeReader) -> str | None:
        return "motifs" if MOTIF_MODEL.fitting(at) is None else None

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        """The nearest transitions between the clips of two frames parts; contexts need no worker."""
        return ShardResult(shard) if shard.stage == CONTEXTS else _compare(root, shard)

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """Replace the transitions of the datasets whose contexts are in the results; candidates stay in their parts."""
        for result in results:
            if result.shard.stage == CONTEXTS:
                _load_contexts(con, root, result.shard)


TRANSITIONS: Final = Transitions()


def _parts_of_datasets(con: Connection) -> dict[str, list[Part]]:
    """The frames parts of each dataset, by name."""
    by_dataset = sorted(frames_parts(con), key=lambda p: (p.dataset, p.part))
    return {dataset: list(parts) for dataset, parts in groupby(by_dataset, lambda p: p.dataset)}


def candidates_file(key: str) -> str:
    return f"transitions/{key[:16]}.parquet"


@dataclass(frozen=True)
class _Group:
    """The clips of one part: names, rates, bones and windows."""

    clips: list[str]
    fps: NDArray[np.float64]
    bones: list[NDArray[np.float64]]
    sizes: NDArray[np.float64]
    windows: Windowed


def _compare(lake_root: Path, shard: Shard) -> ShardResult:
    from motionlake.deep_motifs.motion_graph.transitions import candidates, nearest_per_word

    started = time.perf_counter()
    lake = Lake(lake_root)
    config = TransitionsConfig(**shard.spec["transitions"])
    first, second = shard.spec["parts"]
    a = _read(lake, shard, first, config)
    b = a if second == first else _read(lake, shard, second, config)
    found = candidates(a.windows, b.windows, _agree(a, b, config), config, same=a is b)
    found = nearest_per_word(found, a.windows, b.windows, config.per_word)
    rate = shard.spec["words"]["fps"]
    columns = [*_end(a, found.left, rate), *_end(b, found.right, rate), pa.array(found.distance)]
    table = pa.Table.from_arrays(columns, schema=ROWS)
    file = candidates_file(shard.key)
    size = write_part(lake.path(file), table, {"key": shard.key})
    return ShardResult(shard, table.num_rows, size, (file,), time.perf_counter() - started)


def _read(lake: Lake, shard: Shard, part: str, config: TransitionsConfig) -> _Group:
    from motionlake.deep_motifs.motion_graph.transitions import windowed
    from motionlake.motion.kinematics import bone_vectors, world_rotations

    words = WordConfig(**shard.spec["words"])
    clips, fps, bones, sizes, positions, counts = [], [], [], [], [], []
    for stored in frames.read_part(sound(lake, lake.frames_part(shard.dataset, part)), shard.spec["clips"]):
        clip = stored.recorded()
        joints, rotations = clip.positions.astype(float), clip.rotations.astype(float)
        sampled = resample(joints, clip.fps, words.fps)
        clips.append(clip.clip)
        fps.append(clip.fps)
        bones.append(bone_vectors(joints, world_rotations(rotations)).mean(axis=0))
        sizes.append(body_length(joints))
        counts.append(len(windows(len(sampled), words)))
        positions.append(sampled[: _usable(len(sampled), len(joints), clip.fps / words.fps, config.window)])
    if not clips:
        raise ValueError(f"part {part} holds no clip of the lake")
    cut = windowed(positions, counts, words.stride, config.window)
    return _Group(clips, np.array(fps), bones, np.array(sizes), cut)


def _usable(sampled: int, count: int, ratio: float, window: int) -> int:
    """How many frames at the words' rate leave every window room to be blended at the clip's own rate."""
    starts = np.arange(max(sampled - window + 1, 0))
    fits = np.round(starts * ratio) + max(2, round(window * ratio)) <= count
    return int(fits.sum()) + window - 1


def _agree(a: _Group, b: _Group, config: TransitionsConfig) -> NDArray[np.bool_]:
    """[clips of a, clips of b] whether all bones are about as long and point alike at rest."""
    bones_a, bones_b = np.stack(a.bones), np.stack(b.bones)
    differ = np.linalg.norm(bones_a[:, None] - bones_b[None], axis=-1).max(axis=-1)
    # Stored frames are quantised: bones of one body differ by a fraction of a millimetre.
    limit = config.proportions * (a.sizes[:, None] + b.sizes[None]) / 2 + 1e-3
    return np.asarray(differ <= limit)


def _end(group: _Group, rows: NDArray[np.int64], rate: float) -> list[pa.Array]:
    clip = group.windows.clip[rows]
    native = np.round(group.windows.frame[rows] * group.fps[clip] / rate).astype(np.int64)
    names = pa.array(group.clips).take(pa.array(clip))
    return [names, pa.array(native), pa.array(group.windows.word[rows].astype(np.int32))]


def _load_contexts(con: Connection, root: Path, shard: Shard) -> None:
    """Pick the nearest candidates of each word, and compare the signatures around both ends of these transitions."""
    from motionlake.deep_motifs.motion_graph.transitions import context_distances
    from motionlake.lake.corpus import read_corpus

    config = TransitionsConfig(**shard.spec["transitions"])
    parameters = {"files": [str(root / f) for f in shard.spec["files"]], "per_word": config.per_word}
    found, corpus = fetch_table(con, "transition_candidates", parameters), read_corpus(con, shard.dataset)

    def end(side: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        clips = [corpus.positions[name] for name in found.column(f"{side}_clip").to_pylist()]
        return np.array(clips, dtype=np.int64), numbers(found.column(f"{side}_word")).astype(np.int64)

    words: list[NDArray[np.integer[Any]]] = [corpus.motifs[corpus.words_of(i)] for i in range(len(corpus.clips))]
    distances = context_distances(words, (end("from"), end("to")), corpus.idf, corpus.ground, config.context)
    rows = found.append_column("context_distance", pa.array(distances, pa.float64()))
    load_rows(con, "load_transitions", rows, {"dataset": shard.dataset})

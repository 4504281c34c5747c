"""Stage "postures": a dictionary, ready-made or trained on the lake, turns every frame at its rate into a symbol.

PESTA, sections 5.1 and 5.2. A trained dictionary is frozen: new clips are coded with it (section 8.5.1).
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from motionlake.arrays import Float32Array, Progress
from motionlake.errors import UserError
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, checkpoint_file, copy_weights, file_hash, fitting_model, save_model
from motionlake.lake.parts import PartWriter, check_part, replacing
from motionlake.motion.features import word_features
from motionlake.pesta.config import ENOUGH, PRETRAINED_POSTURES
from motionlake.stages.derived import PART_KEYS, Part, clips_of, derive, due, frames_parts
from motionlake.stages.shard import Shard, ShardResult
from numpy.typing import NDArray
from safetensors import safe_open

if TYPE_CHECKING:
    from motionlake.pesta.dictionary import PostureDictionary

NAME = "postures"
VERSION = 1
DICTIONARY = "postures"
MOST_CLIPS = 2_000
ROWS = pa.schema([*PART_KEYS, ("symbol", pa.int32())])


def dictionary_key(config: LakeConfig) -> str:
    """Covers all that shapes a dictionary but the clips it is trained on: those it keeps once trained."""
    return config_hash(DICTIONARY, VERSION, config.postures)


def fitting_dictionary(con: Connection, config: LakeConfig) -> Model | None:
    """The current dictionary if it was made for this configuration."""
    return fitting_model(con, DICTIONARY, dictionary_key(config))


def takes_ready_made(con: Connection, config: LakeConfig) -> bool:
    """Whether the lake starts with the ready-made dictionary, and does not train one."""
    wanted = config.postures
    if not PRETRAINED_POSTURES.fits(wanted):
        return False
    return wanted.weights == "shipped" or count(con, config) < ENOUGH * wanted.m


def count(con: Connection, config: LakeConfig) -> float:
    """About how many postures the lake holds."""
    seconds = sum(row["frames"] / row["fps"] for row in fetch(con, "clip_lengths"))
    return float(config.postures.fps * seconds)


def training_sample(con: Connection, lake: Lake, config: LakeConfig) -> list[Float32Array]:
    """[T, D] postures of clips drawn at random, of each the same share, up to `max_postures`; in order of the clips."""
    rows = fetch(con, "clip_lengths")
    random = np.random.default_rng(config.postures.seed)
    chosen = sorted(random.permutation(len(rows))[:MOST_CLIPS].tolist())
    clips = {rows[i]["clip"]: rows[i] for i in chosen}
    seconds = sum(row["frames"] / row["fps"] for row in clips.values())
    share = min(1.0, config.postures.max_postures / max(1.0, seconds * config.postures.fps))
    found: dict[str, Float32Array] = {}
    for dataset, part in sorted({(row["dataset"], row["part"]) for row in clips.values()}):
        path = lake.path(lake.frames_part(dataset, part))
        for clip in frames.read_clips(path, [name for name, row in clips.items() if row["part"] == part]):
            found[clip.clip] = _postures(clip, config)
    return [_some(found[name], share, random) for name in clips]


def _postures(clip: frames.Frames, config: LakeConfig) -> Float32Array:
    return word_features(clip.positions.astype(float), clip.rotations.astype(float), clip.fps, config.postures.frames)


def _some(features: Float32Array, share: float, random: np.random.Generator) -> Float32Array:
    count = int(np.ceil(share * len(features)))
    return features[np.sort(random.choice(len(features), count, replace=False))]


def train(
    lake: Lake, features: list[Float32Array], config: LakeConfig, file: str, progress: Progress | None = None
) -> dict[str, Any]:
    """Train the dictionary of the configuration, save it as `file`; returns its figures.

    A training that was interrupted goes on from its checkpoint in the lake.

    Raises:
        UserError: the lake holds fewer postures than symbols are asked for.
    """
    from motionlake.pesta.posture_training import fit_dictionary

    checkpoint = checkpoint_file(lake, "postures")
    count = sum(map(len, features))
    try:
        dictionary = fit_dictionary(features, config.postures, checkpoint=checkpoint, progress=progress)
    except ValueError as error:
        raise UserError(
            f"{lake.root}: holds {count} postures to train on: {error}; take in more clips, or set m below [postures] "
            f"in {lake.config_file} to {count // 2} or less"
        ) from error
    save_model(lake, file, dictionary.save)
    return dict(dictionary.figures)


def take_weights(lake: Lake, _config: LakeConfig, weights: Path, file: str) -> dict[str, Any]:
    """Copy a ready-made dictionary into the lake as `file`; returns its figures."""
    from motionlake.pesta.dictionary import METADATA_KEY

    with safe_open(weights, framework="numpy") as tensors:
        figures = json.loads(tensors.metadata()[METADATA_KEY])["figures"]
    return copy_weights(lake, weights, file, figures, "clips", "postures", "occupied", "perplexity")


def keyed(con: Connection, lake: Lake, dictionary: Model) -> list[Part]:
    """Every live part with the key its symbols must have."""
    return derive(frames_parts(con), NAME, VERSION, file_hash(lake.path(dictionary.file)))


def plan(con: Connection, lake: Lake, dictionary: Model) -> list[Shard]:
    def spec(part: Part) -> dict[str, object]:
        return {"dictionary": dictionary.file, "clips": clips_of(con, part.part)}

    return due(con, NAME, "frames", keyed(con, lake, dictionary), spec)


def codes_file(key: str) -> str:
    return f"postures/{key[:16]}.parquet"


def run(lake_root: Path, shard: Shard) -> ShardResult:
    """The symbol of every posture of every clip of one frames part."""
    from motionlake.pesta.dictionary import load_dictionary

    started = time.perf_counter()
    lake = Lake(lake_root)
    dictionary = load_dictionary(lake.path(shard.spec["dictionary"]))
    file = codes_file(shard.key)
    with replacing(lake.path(file)) as temporary:
        writer = PartWriter(temporary, ROWS, {"key": shard.key})
        for clip in frames.read_part(lake.path(lake.frames_part(shard.dataset, shard.part)), shard.spec["clips"]):
            writer.append(_rows(clip.clip, shard, codes_of(dictionary, clip)))
        writer.close()
    size = check_part(lake.path(file), writer.rows)
    return ShardResult(shard, writer.rows, size, (file,), time.perf_counter() - started)


def codes_of(dictionary: PostureDictionary, clip: frames.Frames) -> NDArray[np.int32]:
    """[T] symbols of a clip's postures, at the rate of the dictionary."""
    positions, rotations = clip.positions.astype(float), clip.rotations.astype(float)
    return dictionary.encode(word_features(positions, rotations, clip.fps, dictionary.config.frames))


def _rows(clip: str, shard: Shard, codes: NDArray[np.int32]) -> pa.Table:
    keys = [pa.repeat(pa.scalar(value), len(codes)) for value in (clip, shard.part, shard.key)]
    return pa.Table.from_arrays([*keys, pa.array(codes, pa.int32())], schema=ROWS)


def read_codes(path: Path) -> Iterator[tuple[str, NDArray[np.int32]]]:
    """(clip, [T] symbols) of every clip of a part of coded postures, in order."""
    table = pq.read_table(path, columns=["clip", "symbol"])
    symbols = table.column("symbol").to_numpy()
    start = 0
    for clip, stop in frames.runs_of(table.column("clip")):
        yield clip, symbols[start:stop]
        start = stop


def load(_con: Connection, _root: Path, _results: Sequence[ShardResult]) -> None:
    """A dictionary enters the catalog together with the strings over it, so that the two always agree."""

"""Stage "embed": a word network, pretrained or trained on the lake, turns every motion word into a vector."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array
from motionlake.columns import numbers, read_parquet
from motionlake.lake.frames import runs_of
from motionlake.lake.integrity import sound, sound_files
from motionlake.lake.layout import Lake
from motionlake.lake.loaded import loaded
from motionlake.motion.features import WordConfig, word_windows
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import PART_KEYS, Part, PartStage, Shard, part_keys
from motionlake.stages.word_network import WORD_NETWORK
from motionlake.stages.words import WORDS, read_features
from motionlake.threads import in_threads
from numpy.typing import NDArray

THREADS: Final = 2  # that read parts
ROWS = pa.schema([*PART_KEYS, ("word", pa.int32()), ("embedding", pa.list_(pa.float32()))])


class Embed(PartStage):
    """A vector a word, served from its Parquet parts."""

    name = "embed"
    about = "train the word network if there is none, embed every word"
    source = WORDS
    model = WORD_NETWORK
    folder = "embeddings"
    schema = ROWS

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        network = WORD_NETWORK.serving(at)
        return {"features": WORDS.file(part.upstream), "network": network.file, "words": asdict(at.config.words)}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        from motionlake.deep_motifs.words.network import load_network

        config = WordConfig(**shard.spec["words"])
        network = loaded(load_network, lake, shard.spec["network"])
        read = read_features(sound(lake, shard.spec["features"]))
        for clip, vectors in network.embed_clips((clip, word_windows(features, config)) for clip, features in read):
            count, width = vectors.shape
            offsets = pa.array(np.arange(0, count * width + 1, width, dtype=np.int32))
            lists = pa.ListArray.from_arrays(offsets, pa.array(vectors.ravel()))
            words = pa.array(np.arange(count, dtype=np.int32))
            yield pa.Table.from_arrays([*part_keys(clip, shard, count), words, lists], schema=ROWS)


EMBED: Final = Embed()


def read_embeddings(path: Path, *, threads: bool = True) -> tuple[pa.Table, NDArray[np.float32]]:
    """(clip, part, word) rows and [n, d] vectors of an embeddings part; `threads`: as of `read_parquet`."""
    table = read_parquet(path, threads=threads)
    vectors = numbers(table.column("embedding").combine_chunks().flatten())
    return table.select(["clip", "part", "word"]), vectors.reshape(table.num_rows, -1)


def vectors_of_clips(at: LakeReader, parts: Mapping[str, str]) -> dict[str, Float32Array]:
    """[n, d] embedded words of some clips, by the frames part of each, of those that the stage has embedded.

    Raises:
        DamagedError: a part is not as it was written.
    """
    done, wanted = at.done(EMBED.name), set(parts.values())
    made = [part for part in EMBED.parts(at) or [] if part.key in done and part.part in wanted]
    files = sound_files(at.lake, [EMBED.file(part.key) for part in made])

    def read(number: int) -> dict[str, Float32Array]:
        rows, vectors = read_embeddings(files[number], threads=False)
        runs = runs_of(rows.column("clip"))
        return {clip: vectors[run] for clip, run in runs if parts.get(clip) == made[number].part}

    return {clip: vectors for each in in_threads(read, range(len(made)), THREADS) for clip, vectors in each.items()}

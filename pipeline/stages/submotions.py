"""Stage "submotions": the sub-motion encoder, pretrained or trained, makes a vector of every window of every clip.

DeepHuMS, section 3.3.5. Vectors of two encoders do not compare, so a lake serves those of one. They are by far the most
numbers that a lake has of its clips, so they stay in Parquet parts, in half precision; the catalog lists the parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deephums.config import DIMENSION
from motionlake.deephums.sequence import in_sequence, piece_windows
from motionlake.lake.catalog import fetch
from motionlake.lake.layout import Lake
from motionlake.lake.loaded import loaded
from motionlake.stages.descriptor_network import sequence_of
from motionlake.stages.descriptors import VectorStage
from motionlake.stages.part_clips import clips_of_shard
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import PART_KEYS, Part, Shard, clips_of, part_keys
from motionlake.stages.submotion_encoder import SUBMOTION_ENCODER

KEPT: Final = np.float16  # vectors in a lake
ROWS: Final = pa.schema(
    [
        *PART_KEYS, ("start", pa.int64()), ("stop", pa.int64()),
        ("descriptor", pa.list_(pa.float16(), DIMENSION)),
    ]
)  # fmt: skip
Window = tuple[int, int]
Embed = Callable[[Float32Array, Int64Array], Float32Array]


class Submotions(VectorStage):
    """A vector a window, served from its Parquet parts."""

    name = "submotions"
    about = "train the sub-motion encoder if there is none, vectors of the windows of clips"
    model = SUBMOTION_ENCODER
    folder = "submotions"
    tables = ("submotion_parts",)
    schema = ROWS
    statement = "load_submotion_parts"
    version = 3  # all windows of a clip are read at once

    def alongside(self, at: LakeReader) -> bool:
        return at.config.submotion.recipe != "deephums"  # that one reads the descriptors of clips

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        encoder = SUBMOTION_ENCODER.serving(at)
        described = encoder.metrics.get("descriptors")  # recipe "deephums": the network it was trained to agree with
        first = fetch(at.con, "model_file", {"model": described})[0]["file"] if described else None
        clips = clips_of(at.con, part.part)
        return {"network": encoder.file, "model": encoder.model, "descriptors": first, "clips": clips}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        embed, cut = _reader(lake, shard.spec)
        for clip in clips_of_shard(lake, shard, rotations=False):
            windows = cut(len(clip.positions), clip.fps)
            vectors = embed(sequence_of(clip), in_sequence(windows, len(clip.positions), clip.fps)).astype(KEPT)
            bounds = np.array(windows, dtype=np.int64)
            lists = pa.FixedSizeListArray.from_arrays(pa.array(vectors.ravel()), DIMENSION)
            keys = part_keys(clip.clip, shard, len(windows))
            yield pa.Table.from_arrays([*keys, pa.array(bounds[:, 0]), pa.array(bounds[:, 1]), lists], schema=ROWS)


SUBMOTIONS: Final = Submotions()


def _reader(lake: Lake, spec: Mapping[str, Any]) -> tuple[Embed, Callable[[int, float], list[Window]]]:
    """What makes vectors of windows, and how clips are cut into them.

    Recipe "deephums" compares pieces with the descriptors that the descriptor network gives to whole clips.
    """
    if spec["descriptors"] is None:
        from motionlake.deephums.submotions import load_submotion

        return loaded(load_submotion, lake, spec["network"]).embed_windows, piece_windows
    from motionlake.deephums.network import load_descriptor

    network = loaded(load_descriptor, lake, spec["descriptors"])
    return lambda sequence, _: network.embed([sequence]), lambda n_frames, _fps: [(0, n_frames)]

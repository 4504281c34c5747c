"""Stage "submotions": the sub-motion encoder, pretrained or trained, makes a vector of every window of every clip.

DeepHuMS, section 3.3.5. Vectors of two encoders do not compare, so a lake serves those of one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array
from motionlake.deephums.config import DIMENSION
from motionlake.deephums.sequence import clip_sequence, piece_windows
from motionlake.lake.catalog import fetch
from motionlake.lake.layout import Lake
from motionlake.lake.loaded import loaded
from motionlake.stages.descriptors import VectorStage
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Part, Shard, clips_of, clips_of_shard
from motionlake.stages.submotion_encoder import SUBMOTION_ENCODER

ROWS = pa.schema(
    [
        ("clip", pa.string()), ("start", pa.int64()), ("stop", pa.int64()),
        ("descriptor", pa.list_(pa.float32(), DIMENSION)), ("part", pa.string()),
    ]
)  # fmt: skip
Window = tuple[int, int]
Embed = Callable[[Sequence[Float32Array]], Float32Array]


class Submotions(VectorStage):
    """A vector a window."""

    name = "submotions"
    about = "train the sub-motion encoder if there is none, vectors of the windows of clips"
    model = SUBMOTION_ENCODER
    tables = ("submotions",)
    schema = ROWS
    statement = "load_submotions"
    version = 2  # without calibration poses

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        encoder = SUBMOTION_ENCODER.serving(at)
        described = encoder.metrics.get("descriptors")  # recipe "deephums": the network it was trained to agree with
        first = fetch(at.con, "model_file", {"model": described})[0]["file"] if described else None
        clips = clips_of(at.con, part.part)
        return {"network": encoder.file, "model": encoder.model, "descriptors": first, "clips": clips}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        embed, cut = _reader(lake, shard.spec)
        for clip in clips_of_shard(lake, shard, rotations=False):
            ranges = cut(len(clip.positions), clip.fps)
            positions = clip.positions.astype(float)
            vectors = embed([clip_sequence(positions[start:stop], clip.fps) for start, stop in ranges])
            bounds = np.array(ranges, dtype=np.int64).reshape(-1, 2)
            lists = pa.FixedSizeListArray.from_arrays(pa.array(vectors.ravel()), DIMENSION)
            columns = [pa.repeat(clip.clip, len(ranges)), pa.array(bounds[:, 0]), pa.array(bounds[:, 1]), lists]
            yield pa.Table.from_arrays([*columns, pa.repeat(shard.part, len(ranges))], schema=ROWS)


SUBMOTIONS: Final = Submotions()


def _reader(lake: Lake, spec: Mapping[str, Any]) -> tuple[Embed, Callable[[int, float], list[Window]]]:
    """What makes vectors of windows, and how clips are cut into them.

    Recipe "deephums" compares pieces with the descriptors that the descriptor network gives to whole clips.
    """
    if spec["descriptors"] is None:
        from motionlake.deephums.submotions import load_submotion

        return loaded(load_submotion, lake, spec["network"]).embed, piece_windows
    from motionlake.deephums.network import load_descriptor

    return loaded(load_descriptor, lake, spec["descriptors"]).embed, lambda n_frames, _fps: [(0, n_frames)]

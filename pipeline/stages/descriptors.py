"""Stage "descriptors": a network, pretrained or trained on clips of the lake, turns every clip into one vector.

DeepHuMS, section 3.2. Descriptors of two networks do not compare, so a lake serves those of one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, Final

import pyarrow as pa
from motionlake.deephums.config import DIMENSION
from motionlake.lake import frames
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, model_of
from motionlake.stages.descriptor_network import DESCRIPTOR_NETWORK, sequence_of
from motionlake.stages.reader import LakeReader
from motionlake.stages.shard import Shard
from motionlake.stages.stage import Part, PartStage, clips_of

AT_ONCE = 64  # clips in memory
ROWS = pa.schema([("clip", pa.string()), ("descriptor", pa.list_(pa.float32(), DIMENSION)), ("part", pa.string())])


class Descriptors(PartStage):
    """A vector a clip. Those of a new network enter together: the old ones serve until all are there."""

    name = "descriptors"
    about = "train the descriptor network if there is none, one vector a clip"
    model = DESCRIPTOR_NETWORK
    tables = ("descriptors",)
    schema = ROWS
    statement = "load_descriptors"

    def shaping(self, at: LakeReader) -> Sequence[Any] | None:
        network = DESCRIPTOR_NETWORK.fitting(at)
        return None if network is None else (network.model, at.file_hash(network.file))

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        network = DESCRIPTOR_NETWORK.serving(at)
        return {"network": network.file, "model": network.model, "clips": clips_of(at.con, part.part)}

    def at_once(self, at: LakeReader) -> bool:
        served = served_network(at.con)
        return served is not None and served.model != DESCRIPTOR_NETWORK.serving(at).model

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        from motionlake.deephums.trained import load_descriptor

        network = load_descriptor(lake.path(shard.spec["network"]))
        clips = frames.read_part(lake.path(lake.frames_part(shard.dataset, shard.part)), shard.spec["clips"])
        while some := list(islice(((clip.clip, sequence_of(clip)) for clip in clips), AT_ONCE)):
            vectors = network.embed([sequence for _, sequence in some])
            lists = pa.FixedSizeListArray.from_arrays(pa.array(vectors.ravel()), DIMENSION)
            names = pa.array([name for name, _ in some], pa.string())
            yield pa.Table.from_arrays([names, lists, pa.repeat(shard.part, len(some))], schema=ROWS)


DESCRIPTORS: Final = Descriptors()


def served_network(con: Connection) -> Model | None:
    """The network whose descriptors the lake serves: those of another do not compare with them."""
    rows = fetch(con, "served_descriptors")
    return model_of(rows[0]) if rows else None

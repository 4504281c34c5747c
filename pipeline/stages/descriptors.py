"""Stage "descriptors": a network, pretrained or trained on clips of the lake, turns every clip into one vector.

DeepHuMS, section 3.2. Descriptors of two networks do not compare, so a lake serves those of one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, ClassVar, Final

import pyarrow as pa
from motionlake.deephums.config import DIMENSION
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.loaded import loaded
from motionlake.lake.models import Model, model_of
from motionlake.stages.descriptor_network import DESCRIPTOR_NETWORK, sequence_of
from motionlake.stages.model_kind import ModelKind
from motionlake.stages.part_clips import clips_of_shard
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Part, PartStage, Shard, clips_of

AT_ONCE = 64  # clips in memory
ROWS = pa.schema([("clip", pa.string()), ("descriptor", pa.list_(pa.float32(), DIMENSION)), ("part", pa.string())])


class VectorStage(PartStage):
    """A stage that fills the table of its name with vectors by its model.

    Those of a new network enter together: the old ones serve until all are there.
    """

    model: ClassVar[ModelKind[Any]]

    def shaping(self, at: LakeReader) -> Sequence[Any] | None:
        network = self.model.fitting(at)
        return None if network is None else (network.model, at.file_hash(network.file))

    def at_once(self, at: LakeReader) -> bool:
        served = self.served(at.con)
        return served is not None and served.model != self.model.serving(at).model

    def served(self, con: Connection) -> Model | None:
        """The network whose vectors the lake serves: those of another do not compare with them."""
        rows = fetch(con, f"served_{self.name}")
        return model_of(rows[0]) if rows else None


class Descriptors(VectorStage):
    """A vector a clip."""

    name = "descriptors"
    about = "train the descriptor network if there is none, one vector a clip"
    model = DESCRIPTOR_NETWORK
    tables = ("descriptors",)
    schema = ROWS
    statement = "load_descriptors"
    version = 2  # without calibration poses

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        network = DESCRIPTOR_NETWORK.serving(at)
        return {"network": network.file, "model": network.model, "clips": clips_of(at.con, part.part)}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        from motionlake.deephums.network import load_descriptor

        network = loaded(load_descriptor, lake, shard.spec["network"])
        clips = ((clip.clip, sequence_of(clip)) for clip in clips_of_shard(lake, shard, rotations=False))
        while some := list(islice(clips, AT_ONCE)):
            vectors = network.embed([sequence for _, sequence in some])
            lists = pa.FixedSizeListArray.from_arrays(pa.array(vectors.ravel()), DIMENSION)
            names = pa.array([name for name, _ in some], pa.string())
            yield pa.Table.from_arrays([names, lists, pa.repeat(shard.part, len(some))], schema=ROWS)


DESCRIPTORS: Final = Descriptors()

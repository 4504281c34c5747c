"""Stage "quality": what of each clip no body did, and whether the clip is ok, doubtful or bad."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import pyarrow as pa
from motionlake.lake.catalog import fetch
from motionlake.lake.layout import Lake
from motionlake.motion.quality import MEASURES, Quality, Recording, check
from motionlake.motion.quality_config import QualityConfig
from motionlake.stages.part_clips import stored_clips
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import PART_KEYS, Part, PartStage, Shard

RANGE: Final = pa.struct(
    [
        ("fault", pa.string()), ("joint", pa.string()), ("start", pa.int64()), ("stop", pa.int64()),
        ("severity", pa.float64()),
    ]
)  # fmt: skip
LEVEL: Final = pa.struct(
    [
        ("fault", pa.string()), ("joint", pa.string()), ("start", pa.int64()), ("stop", pa.int64()),
        ("rung", pa.int64()), ("level", pa.float64()), ("severity", pa.float64()),
    ]
)  # fmt: skip
ROWS: Final = pa.schema(
    [
        *PART_KEYS, ("verdict", pa.string()), *((name, pa.float64()) for name in MEASURES), ("ranges", pa.list_(RANGE)),
        ("levels", pa.list_(LEVEL)), ("bad_share", pa.float64()),
    ]
)  # fmt: skip


class QualityStage(PartStage):
    """A row a clip, with its faulty ranges, and with how far above their thresholds they go: what of it is usual in the
    dataset is for views to say, since that changes as the dataset grows."""

    name = "quality"
    version = 5
    about = "what of every clip no body did, by range, with a verdict"
    folder = "quality"
    schema = ROWS
    by_name = True

    def shaping(self, at: LakeReader) -> Sequence[Any]:
        return (at.config.of(QualityConfig),)

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        bodies = fetch(at.con, "part_bodies", {"part": part.part})
        return {
            "clips": [row["clip"] for row in bodies],
            "bodies": {row["clip"]: [row["twist"], row["filled"], row["repaired"]] for row in bodies},
            "quality": asdict(at.config.of(QualityConfig)),
        }

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        config = QualityConfig(**shard.spec["quality"])
        for clip in stored_clips(lake, shard):
            twist, filled, repaired = shard.spec["bodies"][clip.clip]
            recording = Recording.of(
                clip.positions, clip.rotations, clip.fps, twist=twist, filled=tuple(filled), repaired=repaired
            )
            found = check(recording, config)
            yield pa.Table.from_pylist([_row(clip.clip, shard, found, config)], schema=ROWS)


QUALITY: Final = QualityStage()


def _row(clip: str, shard: Shard, found: Quality, config: QualityConfig) -> dict[str, Any]:
    ranges = [
        {"fault": f.kind, "joint": f.joint, "start": f.start, "stop": f.stop, "severity": f.severity}
        for f in found.faults
    ]
    levels = [{"fault": each.kind, **asdict(each)} for each in found.levels]
    keys = {"clip": clip, "part": shard.part, "key": shard.key}
    return {
        **keys, "verdict": found.verdict, **found.measures, "ranges": ranges, "levels": levels,
        "bad_share": config.bad_share,
    }  # fmt: skip

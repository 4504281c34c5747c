"""The Parquet parts that a shard of clips becomes."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import pyarrow as pa
from motionlake.lake import frames, raw
from motionlake.lake.config import FramesConfig
from motionlake.lake.layout import Lake
from motionlake.lake.motion_footer import footer_clip, motion_footer
from motionlake.lake.parts import PartWriter, replacing
from motionlake.motion.clip import SourceClip
from motionlake.stages.shard import Shard

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion


class FrameParts:
    """The parts of one shard that makes clips, canonical frames and raw channels, opened when a clip needs them.

    Attributes:
        written: files relative to the lake, and how many rows each has.
    """

    def __init__(self, lake: Lake, shard: Shard, stack: ExitStack) -> None:
        self._lake, self._shard, self._stack = lake, shard, stack
        self._frames = lake.frames_part(shard.dataset, shard.part)
        self._writers: dict[str, PartWriter] = {}
        self._clips: dict[str, dict[str, Any]] = {}

    @property
    def written(self) -> dict[str, int]:
        return {name: writer.rows for name, writer in sorted(self._writers.items())}

    def write(self, name: str, clip: SourceClip, motion: CanonicalMotion, layout: str, config: FramesConfig) -> None:
        """Append one clip; clips must come by name. `layout` is that of its channels."""
        part = self._shard.part
        canonical = frames.Frames(name, clip.fps, motion.rotations, motion.positions)
        self._clips[name] = footer_clip(clip.fps, motion.rest_offsets)
        self._append(self._frames, frames.to_table(canonical, part, config.position_step, config.rotation_step))
        height = motion.body_height / motion.metres_per_unit
        self._append(self._lake.raw_part(layout, part), raw.to_table(name, part, clip, height))

    def _append(self, name: str, table: pa.Table) -> None:
        if name not in self._writers:
            temporary = self._stack.enter_context(replacing(self._lake.path(name)))
            writer = PartWriter(temporary, table.schema, {"key": self._shard.key})
            self._stack.callback(self._close, name, writer)
            self._writers[name] = writer
        self._writers[name].append(table)

    def _close(self, name: str, writer: PartWriter) -> None:
        writer.close(motion_footer(self._clips) if name == self._frames else {})

"""Mending a lake: each damaged file is made again as it was, from source files, raw blocks or what lies upstream."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from motionlake.errors import ClipError, DamagedError, UserError
from motionlake.formats.limits_config import Limits
from motionlake.jobs.run import update
from motionlake.jobs.session import Session
from motionlake.lake.catalog import fetch, load_rows, reading, run_sql, table_of, writing
from motionlake.lake.file_list import FileSums, list_files, listed_in, sums_of
from motionlake.lake.mend import Mended
from motionlake.lake.named_files import frames_by_part, named_files
from motionlake.lake.verify import deep_faults
from motionlake.names import on_disk
from motionlake.stages.frames import FRAMES, shard_of
from motionlake.stages.frames_from_raw import raw_blocks, write_frames_from_raw
from motionlake.stages.ingest import KEY_ROWS
from motionlake.stages.model_kind import CHOSEN, Selection
from motionlake.stages.reader import LakeReader, lake_reader
from motionlake.stages.registry import EVERY, KINDS, ON_REQUEST
from motionlake.stages.source_files import SourceFile, content_hash
from motionlake.stages.sources import known_roots
from motionlake.stages.stage import PartStage, Shard, ShardStage
from motionlake.stages.synthesize import SYNTHESIZE


def repair_files(session: Session) -> list[Mended]:
    """Make every damaged or missing file of the lake again; what cannot be made again is left as it is and said so."""
    lake = session.lake
    with reading(lake) as con:
        listed = listed_in(con)
        unlisted = [row["file"] for row in fetch(con, "unlisted_files")]
    faults = {f.file: what for f, what in deep_faults(lake, listed, session.progress)}
    faults |= dict.fromkeys(unlisted, "is not listed with its size and hashes")
    if not faults:
        return []
    with reading(lake) as con:
        makers = {row["file"]: row for row in fetch(con, "makers_of_files", {"files": sorted(faults)})}
    job = _Repair(session, listed, faults, makers)
    for stage in EVERY:
        if stage.model is not None:
            job.mend_model(stage.model.name)
        if isinstance(stage, ShardStage):
            job.mend_shards(stage)
        if stage is FRAMES and isinstance(ON_REQUEST, ShardStage):
            job.mend_shards(ON_REQUEST)
    return [job.outcome(file) for file in sorted(faults)]


class _Repair:
    """The damaged files of a lake, one stage after the other.

    Attributes:
        done: what was done, by file.
    """

    def __init__(
        self, session: Session, listed: Mapping[str, FileSums], faults: Mapping[str, str], makers: Mapping[str, Any]
    ) -> None:
        self.done: dict[str, tuple[str, bool]] = {}
        self._session, self._listed, self._faults, self._makers = session, dict(listed), faults, makers
        self._lake = session.lake

    def outcome(self, file: str) -> Mended:
        done, mended = self.done.get(file, ("nothing of this program makes it; put back a copy", False))
        return Mended(file, self._faults[file], done, mended)

    def mend_model(self, kind: str) -> None:
        """Models of one kind: the pretrained file again, else a training that gives the same bytes."""
        for file in [f for f in self._faults if (self._makers.get(f) or {}).get("kind") == kind]:
            self._mend_model(file)

    def _mend_model(self, file: str) -> None:
        with reading(self._lake) as con:
            row = fetch(con, "model_row", {"file": file})[0]
            used = fetch(con, "model_in_use", {"model": row["model"], "file": file})[0]["used"]
        kind, metrics, config = KINDS[row["kind"]], json.loads(row["metrics"]), self._session.config
        if not row["current"] and not used:
            with writing(self._lake) as con:
                run_sql(con, "forget_model", {"model": row["model"]})
            self.done[file] = ("an earlier version that nothing uses: forgotten", True)
            return
        lost = "only a copy of it (`motionlake restore`) gives it back; `motionlake train` makes another"
        try:
            if metrics.get("pretrained"):
                assert kind.pretrained is not None
                kind.take(self._lake, config, kind.pretrained.file, file)
                how = "the pretrained file, copied again"
            else:
                where = Selection(**{name: metrics.get(name) for name in CHOSEN})
                with lake_reader(self._lake, config) as at:
                    same = kind.key(at) == row["key"]
                    data = kind.data(at, where) if same else None
                if data is None:
                    self.done[file] = (f"trained for another config.toml or on clips that left: {lost}", False)
                    return
                kind.train(self._lake, config, data, file, lambda *_: None)
                how = "trained again on the same clips"
        except (UserError, ValueError, OSError) as error:
            self.done[file] = (f"could not be made again ({error}): {lost}", False)
            return
        self._list(file, how, f"training gave another model than before: {lost}")

    def mend_shards(self, stage: ShardStage) -> None:
        """Files that the shards of one stage wrote."""
        rows = {row["key"]: row for file, row in self._makers.items() if row["stage"] == stage.name}
        files = {key: [f for f, r in self._makers.items() if r["key"] == key] for key in rows}
        if not rows:
            return
        shards: list[Shard] = []
        with lake_reader(self._lake, self._session.config) as at:
            for key, row in rows.items():
                try:
                    shard = self._shard(at, stage, row)
                except DamagedError as error:
                    self._say(files[key], f"hangs on what could not be mended ({error})")
                    continue
                if isinstance(shard, Shard):
                    shards.append(shard)
                elif shard is not None:
                    self._say(files[key], shard)
        forgotten = [r for k, r in rows.items() if not any(s.key == k for s in shards) and files[k][0] not in self.done]
        if forgotten:
            self._forget(stage, forgotten, files)
        for shard, found in self._session.remade(stage, self._with_inputs(shards)):
            if isinstance(found, BaseException):
                self._say(files[shard.key], f"could not be made again ({found})")
                continue
            for file in files[shard.key]:
                self._list(file, "made again as it was", "was made again, with other bytes than before", strict=False)

    def _shard(self, at: LakeReader, stage: ShardStage, row: Mapping[str, Any]) -> Any:
        """The shard that made a file; a text where it cannot run any more, None where nothing needs it."""
        if stage is FRAMES:
            return self._frames_shard(at, row)
        if stage is SYNTHESIZE:
            spec = json.loads(row["spec"])
            if not spec:
                return "its request is not known any more; `motionlake remove` it and synthesize again"
            return Shard(stage.name, row["key"], row["part"], row["dataset"], spec, len(spec["motions"]))
        return stage.again(at, row["key"])

    def _frames_shard(self, at: LakeReader, row: Mapping[str, Any]) -> Shard | str | None:
        rows = fetch(at.con, "sources_of_part", {"part": row["part"]})
        files = [SourceFile(r["path"], r["size"], r["mtime_ns"], r["content_hash"]) for r in rows]
        roots = {(r.dataset, r.kept_base): r for r in known_roots(at.con)}
        root = roots.get((row["dataset"], rows[0]["root"])) if rows else None
        if root is None:
            return "the folder it was read from is not known any more"
        gone = [f.path for f in files if content_hash(root.base / on_disk(f.path)) != f.content_hash]
        if gone and self._from_raw(at, row):
            return None
        if gone:
            return (
                f"only the source gives it back: {root.base / gone[0]} "
                f"{f'and {len(gone) - 1} files more are' if len(gone) > 1 else 'is'} not there as it was read; "
                "`motionlake remove` takes its clips out"
            )
        shaping = root.shaping_hash(at.config, at.lake)
        shard = shard_of(root, files, at.config, at.config.of(Limits), shaping)
        if shard.key != row["key"]:
            return "was read with files that have left the lake since, or by other settings; `motionlake ingest` again"
        return shard

    def _from_raw(self, at: LakeReader, row: Mapping[str, Any]) -> bool:
        """Make the frames of source files that are gone from their raw blocks, if all of these are sound."""
        name = self._lake.frames_part(row["dataset"], row["part"])
        if name not in self._faults or any(block in self._faults for block in raw_blocks(at, row["part"])):
            return False
        try:
            write_frames_from_raw(at, row["dataset"], row["part"], row["key"])
        except (ClipError, UserError):
            return False
        how = "made again from the raw channels, to a ten-thousandth of the body's height: its source files are gone"
        self._list(name, how, how, strict=False)
        return True

    def _forget(self, stage: ShardStage, rows: Sequence[Mapping[str, Any]], files: Mapping[str, list[str]]) -> None:
        """Files that are of no use as they are: their stage makes what it needs."""
        for row in rows:
            for file in files[row["key"]]:  # before views are made anew, which would meet it
                self._lake.path(file).unlink(missing_ok=True)
        with writing(self._lake) as con:
            keys = [{"stage": row["stage"], "key": row["key"]} for row in rows]
            load_rows(con, "drop_shards", table_of(keys, KEY_ROWS))
        for row in rows:
            for file in files[row["key"]]:
                self.done[file] = (
                    "forgotten: nothing needs it as it was; `motionlake run all` makes what is due",
                    True,
                )
        if not isinstance(stage, PartStage):
            update(self._session, stage)

    def _with_inputs(self, shards: Sequence[Shard]) -> list[Shard]:
        with reading(self._lake) as con:
            listed = listed_in(con)
        by_part = frames_by_part(listed)
        bad = {file for file in self._faults if not self.done.get(file, ("", False))[1]}
        found = []
        for shard in shards:
            own = {file for file, row in self._makers.items() if row["key"] == shard.key}
            names = named_files(listed, by_part, [shard.part, shard.spec]) - own
            damaged = sorted(names & bad)
            if damaged:
                self._say(sorted(own), f"hangs on {damaged[0]}, which could not be mended")
            else:
                found.append(replace(shard, inputs=tuple(listed[name] for name in sorted(names))))
        return found

    def _list(self, file: str, done: str, otherwise: str, *, strict: bool = True) -> None:
        """Enter a file that was made again. `strict`: only if it is what it was, for other things follow from it."""
        found, before = sums_of(self._lake, file), self._listed.get(file)
        same = before is None or found.sha256 == before.sha256
        if same or not strict:
            with writing(self._lake) as con:
                list_files(con, [found])
        self.done[file] = (done if same else otherwise, same or not strict)

    def _say(self, files: Sequence[str], what: str) -> None:
        for file in files:
            self.done[file] = (what, False)

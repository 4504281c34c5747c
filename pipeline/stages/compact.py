"""Which parts of a lake are small, and which of them go together into larger ones."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Final

from motionlake.lake.catalog import fetch
from motionlake.stages.frames import FRAMES, frames_key
from motionlake.stages.graph import GRAPH
from motionlake.stages.merge import MERGE
from motionlake.stages.reader import LakeReader
from motionlake.stages.registry import EVERY
from motionlake.stages.shortlist import SHORTLIST
from motionlake.stages.stage import STAGING, PartStage, Shard

CLIPS: Final = 256  # of a merged part
FRAMES_OF_PART: Final = 300_000  # at most, 42 minutes at 120 a second: what a worker holds of a part grows with them
WHOLE: Final = (GRAPH.name, SHORTLIST.name)  # stages whose results name every part, one alone too
BEHIND: Final = "hold what `motionlake run all` has to make or to make again first"
NAMED: Final = "are named by what `run neighbours` or `run transitions` made"


@dataclass(frozen=True)
class Plan:
    """What is to be merged.

    Attributes:
        shards: one for each part that is to be made.
        left: by reason, how many small parts stay as they are though they would go with others.
    """

    shards: list[Shard]
    left: Mapping[str, int]


def plan(at: LakeReader, most: int = CLIPS) -> Plan:
    """Cut small parts into groups of at most `most` clips: parts of one folder, of which all stages have made the same.

    A part is small up to half of that, so each clip is written anew a few times at most, however many runs there are.
    """
    small = fetch(at.con, "parts_of_sources", {"clips": most // 2, "frames": FRAMES_OF_PART // 2})
    if len(small) < 2:
        return Plan([], {})
    names = {row["part"] for row in small}
    done: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for row in fetch(at.con, "shards_of_parts", {"parts": sorted(names)}):
        if row["stage"] not in WHOLE:
            done[row["part"]].append(row)
    stages = {stage.name: _Keys(at, stage) for stage in EVERY if isinstance(stage, PartStage)}
    left: Counter[str] = Counter()
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = defaultdict(list)
    for row in small:
        own = done[row["part"]]
        if row["named"]:
            left[NAMED] += 1
        elif row["unfinished"] or not all(_as_now(at, stages, row, shard) for shard in own):
            left[BEHIND] += 1
        else:
            made = "+".join(shard["stage"] for shard in own)
            groups[row["dataset"], row["root"], row["config_hash"], made].append(row)
    shards = [_shard(at, stages, rows, done) for group in groups.values() for rows in _cut(group, most)]
    return Plan(sorted(shards, key=lambda shard: shard.key), left)


class _Keys:
    """The keys of one stage."""

    def __init__(self, at: LakeReader, stage: PartStage) -> None:
        self.stage, parts = stage, stage.parts(at)
        self.shaping = None if parts is None else stage.shaping(at)
        self.now = {part.part: part.key for part in parts or []}

    def files(self, key: str) -> list[str]:
        return [] if self.stage.folder == STAGING else [self.stage.file(key)]


def _as_now(at: LakeReader, stages: Mapping[str, _Keys], row: Mapping[str, Any], shard: Mapping[str, Any]) -> bool:
    """Whether what was made of a part is what the configuration and the models of now would make."""
    if shard["stage"] == FRAMES.name:
        return at.lake.frames_part(row["dataset"], row["part"]) in shard["files"]
    known = stages.get(shard["stage"])
    if known is None:
        return False
    return bool(known.now.get(row["part"]) == shard["key"] and known.files(shard["key"]) == shard["files"])


def _cut(group: Sequence[Mapping[str, Any]], most: int) -> list[list[Mapping[str, Any]]]:
    """Parts by the first path of their files, as many together as a part may hold; none alone."""
    found: list[list[Mapping[str, Any]]] = []
    clips = frames = 0
    for row in group:
        if not found or clips + row["clips"] > most or frames + row["frames"] > FRAMES_OF_PART:
            found.append([])
            clips = frames = 0
        found[-1].append(row)
        clips, frames = clips + row["clips"], frames + row["frames"]
    return [rows for rows in found if len(rows) > 1]


def _shard(
    at: LakeReader,
    stages: Mapping[str, _Keys],
    rows: Sequence[Mapping[str, Any]],
    done: Mapping[str, Sequence[Mapping[str, Any]]],
) -> Shard:
    parts = [row["part"] for row in rows]
    clips = {part: list(own) for part, own in groupby(
        fetch(at.con, "clips_of_parts", {"parts": parts}), key=lambda row: row["part"])}  # fmt: skip
    sources = [(r["path"], r["content_hash"]) for r in fetch(at.con, "files_of_parts", {"parts": parts})]
    dataset = rows[0]["dataset"]
    key = frames_key(dataset, rows[0]["config_hash"], sources)
    keys, part = {FRAMES.name: key}, key[:16]
    files: dict[str, tuple[str, dict[str, str]]] = {
        at.lake.frames_part(dataset, part): (FRAMES.name, {p: at.lake.frames_part(dataset, p) for p in parts})
    }
    for layout in sorted({row["layout"] for own in clips.values() for row in own}):
        held = [p for p in parts if any(row["layout"] == layout for row in clips[p])]
        files[at.lake.raw_part(layout, part)] = FRAMES.name, {p: at.lake.raw_part(layout, p) for p in held}
    made = {shard["stage"]: shard["key"] for shard in done[parts[0]]}
    for name, known in stages.items():  # a stage comes after the one that it reads
        above = keys.get(known.stage.upstream[0])
        if name not in made or above is None or known.shaping is None:
            continue
        keys[name] = known.stage.key_of(above, known.shaping)
        for file in known.files(keys[name]):
            files[file] = name, {p: known.stage.file(known.now[p]) for p in parts}
    spec = {"clips": {p: {row["clip"]: row["path"] for row in own} for p, own in clips.items()},
            "keys": keys, "files": files}  # fmt: skip
    return Shard(MERGE.name, key, part, dataset, spec, sum(row["clips"] for row in rows))

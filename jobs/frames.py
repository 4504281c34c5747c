"""Job "frames": take in new and changed source files, then what is said of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from motionlake.jobs.execute import Outcome, StageJob
from motionlake.jobs.session import Session
from motionlake.lake.catalog import fetch, load_rows, reading, run_sql, table_of, writing
from motionlake.stages import frames
from motionlake.stages.labels import LabelReport, apply_labels, labels_hash
from motionlake.stages.shard import Shard
from motionlake.stages.sources import Difference, Root, compare, known_roots, options_json

JOB = StageJob(frames.NAME, frames.run, frames.load)


@dataclass(frozen=True)
class IngestReport:
    """What taking in a set of roots came to.

    Attributes:
        unchanged: files that were as the lake knows them.
        gone: clips' paths, with their dataset, that have no file any more.
        labels: what the label files said, where they were entered.
        rejects: source files of these roots that stand rejected.
    """

    outcome: Outcome
    unchanged: int
    gone: list[str]
    labels: list[LabelReport]
    rejects: int


def run(
    session: Session, roots: list[Root] | None = None, *, checksum: bool = False, retry_failed: bool = False
) -> IngestReport:
    """Bring the lake up to date with source folders (default: all it knows)."""
    with reading(session.lake) as con:
        roots = known_roots(con) if roots is None else roots
    said = [labels_hash(root) for root in roots]  # first of all: a label file that is not there is a mistake
    due: list[tuple[Root, Difference, str]] = []
    for root in roots:
        shaping = root.shaping_hash(session.config.frames, session.lake)
        with reading(session.lake) as con:
            difference = compare(
                con, session.lake, root, shaping, checksum=checksum, retry_failed=retry_failed,
                progress=lambda done, total: session.progress("hash", done, total),
            )  # fmt: skip
        due.append((root, difference, shaping))
    _remember(session, due)
    shards = [s for root, difference, shaping in due for s in _shards(session, root, difference, shaping, retry_failed)]
    session.notice(f"frames: {sum(s.items for s in shards)} new or changed files")
    outcome = session.execute(JOB, shards)
    session.outcomes[frames.NAME] = outcome
    labels = [
        report
        for root, words in zip(roots, said, strict=True)
        for report in _label(session, root, words, changed=bool(shards))
    ]
    with reading(session.lake) as con:
        rejects = sum(
            r["rejects"]
            for root in roots
            for r in fetch(con, "count_rejects", {"dataset": root.dataset, "root": str(root.base)})
        )
    gone = [f"{root.dataset}/{path}" for root, difference, _ in due for path in difference.gone]
    return IngestReport(outcome, sum(d.unchanged for _, d, _ in due), gone, labels, rejects)


def _remember(session: Session, due: list[tuple[Root, Difference, str]]) -> None:
    with reading(session.lake) as con:
        known = known_roots(con)
    fresh = [root for root, _, _ in due if root not in known]
    touched = [
        {"dataset": root.dataset, "path": f.path, "root": str(root.base), "size": f.size, "mtime_ns": f.mtime_ns}
        for root, difference, _ in due
        for f in difference.touched
    ]
    if fresh or touched:
        with writing(session.lake) as con:
            for root in fresh:
                parameters = {"dataset": root.dataset, "root": root.root, "options": options_json(root.options)}
                run_sql(con, "save_root", {**parameters, "labels_hash": ""})
            load_rows(con, "touch_sources", table_of(touched, frames.SOURCE_ROWS))


def _shards(session: Session, root: Root, difference: Difference, shaping: str, retry_failed: bool) -> list[Shard]:
    """Shards planned by a run that was cut short, as they were planned, then new ones for the rest."""
    rest = {(f.path, f.content_hash): f for f in difference.changed}
    kept, dropped = [], []
    with reading(session.lake) as con:
        earlier = fetch(con, "unfinished_shards", {"dataset": root.dataset})
    for row in earlier:
        shard = frames.shard_from(row)
        if shard.spec["base"] != str(root.base):
            continue
        wanted = [(f["path"], f["content_hash"]) for f in shard.spec["files"]]
        if shard.spec["shaping_hash"] != shaping or not all(w in rest for w in wanted):
            dropped.append({"stage": shard.stage, "key": shard.key})
            continue
        for file in wanted:
            del rest[file]
        if row["state"] == "planned" or retry_failed:
            kept.append(shard)
        else:
            session.notice(f"frames: {shard.items} files failed before ({row['reason']}); --retry-failed tries again")
    if dropped:
        with writing(session.lake) as con:
            load_rows(con, "drop_shards", table_of(dropped, frames.KEY_ROWS))
    return kept + frames.plan(root, list(rest.values()), session.config.frames, shaping)


def _label(session: Session, root: Root, said: str, *, changed: bool) -> list[LabelReport]:
    with reading(session.lake) as con:
        rows = fetch(con, "roots")
    before = {(r["dataset"], r["root"]): r["labels_hash"] for r in rows}
    if not changed and before.get((root.dataset, root.root)) == said:
        return []
    with writing(session.lake) as con:
        reports = apply_labels(con, root)
        parameters = {"dataset": root.dataset, "root": root.root, "options": options_json(root.options)}
        run_sql(con, "save_root", {**parameters, "labels_hash": said})
    return reports


def with_options(root: Root, **options: object) -> Root:
    """The root with options the user gave now in place of those it was first taken in with."""
    given = {k: v for k, v in options.items() if v is not None}
    return replace(root, options=replace(root.options, **given))  # type: ignore[arg-type]

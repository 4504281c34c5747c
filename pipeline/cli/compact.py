"""motionlake compact: fewer and larger files, and room back."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer
from motionlake.cli._output import notice, tell
from motionlake.cli._running import running
from motionlake.cli.common import JsonOption, LakeOption, WorkersOption, option
from motionlake.errors import UserError
from motionlake.lake.layout import open_lake

if TYPE_CHECKING:
    from motionlake.jobs.compact import Compacted


def compact(
    lake: LakeOption,
    clips: Annotated[
        int | None,
        option("--clips", help="Clips of a merged part, at most (256); small is up to half of it."),
    ] = None,
    vacuum: Annotated[
        bool,
        typer.Option("--vacuum", help="Also write the catalog anew, and remove models that nothing uses any more."),
    ] = False,
    keep: Annotated[
        int | None, option("--keep", help="With --vacuum: superseded versions of each model that stay (0).")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be done, and change nothing.")] = False,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
) -> None:
    """Merge the small files that many runs have left into few; nothing is computed anew.

    Every run writes files of its own. Merged, they hold the same rows; searches go on meanwhile, and files that were
    replaced are deleted once nobody reads them. Worth a call after some nights of new clips.

    Example: motionlake compact --lake mylake

    What would be merged or removed: motionlake compact --vacuum --keep 1 --dry-run --lake mylake
    """
    from motionlake.jobs.compact import compact as merge
    from motionlake.jobs.compact import outlook
    from motionlake.stages.compact import CLIPS

    if clips is not None and clips < 2:
        raise UserError(f"--clips {clips}: must be 2 or more")
    if keep is not None and (keep < 0 or not vacuum):
        why = "must be 0 or more" if vacuum else "is of use with --vacuum alone"
        raise UserError(f"--keep {keep}: {why}")
    target = open_lake(lake)
    wanted: dict[str, Any] = {"most": clips or CLIPS, "vacuum": vacuum, "keep": keep or 0}
    if dry_run:
        found = outlook(target, **wanted)
    else:
        with running(target, "compact", workers) as session:
            found = merge(session, **wanted)
    for reason, count in found.left.items():
        notice(f"{count} small parts stay, since they {reason}")
    if found.failed:
        notice(f"{found.failed} merges failed: {found.reason}")
    tell({**asdict(found), "dry_run": dry_run}, _line(found, dry_run=dry_run), as_json=as_json)
    if found.failed:
        raise typer.Exit(1)


def _line(found: Compacted, *, dry_run: bool) -> str:
    """What came of it, for people."""
    arrow = "would become" if dry_run else "became"
    if not found.parts[0]:
        said = [f"nothing to merge: {found.files[0]} files of parts, {found.bytes[0] / 1e6:.1f} MB"]
    else:
        size = "" if dry_run else f", {found.bytes[0] / 1e6:.1f} MB {arrow} {found.bytes[1] / 1e6:.1f}"
        whole = f"with all made of them, {found.files[0]} files {arrow} {found.files[1]}{size}"
        said = [f"{found.parts[0]} parts of frames {arrow} {found.parts[1]}; {whole}"]
    if found.models:
        said.append(f"{len(found.models)} models {'would be' if dry_run else 'were'} removed")
    if found.catalog_bytes[0] != found.catalog_bytes[1]:
        said.append(f"catalog {found.catalog_bytes[0] / 1e6:.1f} MB became {found.catalog_bytes[1] / 1e6:.1f}")
    return "; ".join(said)

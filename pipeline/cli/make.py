"""motionlake compose: motion cut together from clips."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from motionlake.cli._output import check_folder_of, notice, tell, write_csv
from motionlake.cli.common import DatasetOption, JsonOption, LakeOption, MinQualityOption, argument, option, positive
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, reading
from motionlake.lake.layout import open_lake
from motionlake.lake.resolve import resolve_clip
from motionlake.names import json_text

if TYPE_CHECKING:
    from motionlake.retrieval.compose import Composition, LakeGraph

SOURCE: Final = ("clip", "start", "stop", "source", "first", "last", "mirrored")  # columns of --lineage
TRIES: Final = 10  # clips that `--sample` tries to start from


def compose(
    lake: LakeOption,
    out: Annotated[Path, option("--out", "-o", help="BVH file to write.")],
    clip: Annotated[str | None, argument("Clip of the lake to start with.")] = None,
    sample: Annotated[bool, typer.Option("--sample", help="Start with a clip drawn by --seed.")] = False,
    dataset: DatasetOption = None,
    min_quality: MinQualityOption = None,
    seconds: Annotated[float, typer.Option(help="Length of the motion.", callback=positive)] = 60.0,
    seed: Annotated[int, typer.Option(min=0, help="Another seed, another walk.")] = 0,
    constraint: Annotated[
        bool,
        typer.Option("--constraint/--no-constraint", help="Jump only where both clips do alike things."),
    ] = True,
    distance_quantile: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="Share of the possible jumps to use, most alike poses first."),
    ] = 0.5,
    context_quantile: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="Of these, the share to keep, most alike motion first."),
    ] = 0.25,
    plant: Annotated[
        bool,
        typer.Option("--plant/--no-plant", help="Hold feet that stand in place where clips are blended."),
    ] = True,
    lineage: Annotated[Path | None, option(help="Also write where every frame comes from: .csv or .json.")] = None,
    as_json: JsonOption = False,
) -> None:
    """A new motion cut together from a dataset's clips, as BVH.

    It jumps from clip to clip where their poses and what happens around them are alike (a walk in a motion graph).

    Example: motionlake compose salsa/01 --seconds 60 --seed 1 -o new.bvh --lineage new.csv --lake mylake

    The transitions are made by: motionlake run transitions --dataset dances --lake mylake
    """
    from motionlake.formats.write.bvh import write_bvh
    from motionlake.retrieval.compose import compose as compose_motion
    from motionlake.retrieval.compose import read_graph

    target = open_lake(lake)
    check_folder_of(out)
    if lineage is not None:
        check_folder_of(lineage)
        if lineage.suffix not in (".csv", ".json"):
            raise UserError(f"--lineage {lineage}: use a name that ends in .csv or .json")
    if (clip is None) != sample:
        raise UserError("compose: name one clip to start with, or give --sample")
    with reading(target) as con:
        name = resolve_clip(con, clip) if clip is not None else None
        chosen = fetch(con, "clip", {"clip": name})[0]["dataset"] if name else _dataset(con, dataset)
        quantiles = {"distance_quantile": distance_quantile, "context_quantile": context_quantile}
        graph = read_graph(con, target, chosen, constrained=constraint, min_quality=min_quality, **quantiles)
        made = _first_made(
            lambda first: compose_motion(con, target, graph, first, seconds, seed, plant=plant),
            [name] if name else _sampled(graph, seed),
        )
    write_bvh(made.clip, out)
    rows = [asdict(source) for source in made.sources]
    if lineage is not None:
        _write_lineage(lineage, rows)
    frames, fps = len(made.clip.channels), made.clip.fps
    clips = len({source.clip for source in made.sources})
    notice(f"{out}: {frames} frames, {frames / fps:.1f} s, from {len(rows)} pieces of {clips} clips")
    found = {
        "file": str(out), "frames": frames, "fps": fps, "seconds": frames / fps, "rig": made.rig, "seed": seed,
        "constraint": constraint, "jump": made.jump, "graph": made.summary.as_row(), "lineage": rows,
    }  # fmt: skip
    shown = ("out_start", "out_stop", "clip", "start", "stop", "licence", "distance", "context_distance")
    tell(found, [{k: row[k] for k in shown} for row in rows], as_json=as_json)


def _dataset(con: Connection, wanted: str | None) -> str:
    """The dataset to draw from: the one that is named, or the only one."""
    found = [str(row["dataset"]) for row in fetch(con, "status_datasets")]
    held = f"the lake holds {', '.join(found) or 'none'}"
    if wanted is not None and wanted not in found:
        raise UserError(f"{wanted}: no such dataset; {held}")
    if wanted is None and len(found) != 1:
        raise UserError(f"--sample: say from which dataset with --dataset; {held}")
    return wanted or found[0]


def _sampled(graph: LakeGraph, seed: int) -> list[str]:
    """Some clips of the largest component in an order that the seed makes."""
    from motionlake.deep_motifs.motion_graph.graph import starts

    found = starts(graph.graph)
    if not found:
        raise UserError(
            "no clip has transitions that lead back to it; take more of them with --no-constraint or higher quantiles"
        )
    order = random.Random(seed).sample(found, min(len(found), TRIES))
    return [graph.graph.clips[clip].clip for clip in order]


def _first_made(make: Callable[[str], Composition], clips: Sequence[str]) -> Composition:
    """The motion from the first of some clips that one can be made from."""
    from motionlake.deep_motifs.motion_graph.graph import NoWalkError

    for clip in clips[:-1]:
        try:
            return make(clip)
        except NoWalkError as error:
            notice(str(error))
    return make(clips[-1])


def _write_lineage(file: Path, rows: Sequence[dict[str, Any]]) -> None:
    if file.suffix == ".json":
        file.write_text(json_text(rows) + "\n", encoding="utf-8")
    else:
        write_csv(file, list(rows[0]), [list(row.values()) for row in rows])

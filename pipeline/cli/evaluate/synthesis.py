"""motionlake evaluate synthesis."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from motionlake.cli.common import JsonOption, LabelColumn, LakeOption, notice, print_json, print_rows, stage_progress
from motionlake.cli.evaluate.options import DatasetOption, target_of
from motionlake.lake.catalog import reading


def synthesis(
    lake: LakeOption,
    dataset: DatasetOption = None,
    split: Annotated[
        str | None,
        typer.Option(help="Split of the clips to go on from and compare with (default: test).", show_default=False),
    ] = None,
    repository: Annotated[
        str | None,
        typer.Option(help="Split of the clips to learn classes from (default: train).", show_default=False),
    ] = None,
    column: LabelColumn = "label",
    count: Annotated[
        int, typer.Option(min=0, help="Motions of each class that start from clips of other classes.")
    ] = 10,
    seconds: Annotated[
        float | None,
        typer.Option(help="Length of motions (default: as long as the real ones go on).", show_default=False),
    ] = None,
    piece: Annotated[float, typer.Option(help="Seconds; longer clips are cut into pieces as long.")] = 10.0,
    seed: Annotated[int, typer.Option(help="Of what is left to chance.")] = 0,
    pictures: Annotated[
        Path | None,
        typer.Option(help="Draw error curves, a map, strips and bars into this folder.", show_default=False),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """How good the motion is that the lake's generator makes from test clips.

    Errors after the seed (mm) beside those of the last pose held; FID of descriptors; foot sliding, energy, travel
    speed beside real clips; bone-length drift (%); how often the class is recognised; how near the nearest training
    clip is. --json has these by class too, and the units.

    Example: motionlake evaluate synthesis --dataset utd_mhad --json --lake mylake

    Drawn: motionlake evaluate synthesis --dataset utd_mhad --pictures figures --lake mylake
    """
    from motionlake.errors import UserError
    from motionlake.evaluation.synthesis import Plan, evaluate_synthesis

    for name, value in (("--seconds", seconds), ("--piece", piece)):
        if value is not None and not value > 0:
            raise UserError(f"{name} {value:g}: must be more than 0")
    target = target_of(lake, dataset, "none")
    with reading(target) as con, stage_progress() as progress:
        measured = evaluate_synthesis(
            con, target, Plan(count, seed, seconds, piece), dataset=dataset, split=split, repository=repository,
            column=column, notice=notice, progress=progress,
        )  # fmt: skip
    if pictures is not None:
        from motionlake.pictures.html import write_pictures
        from motionlake.pictures.synthesis import synthesis_pictures

        for path in write_pictures(synthesis_pictures(measured), pictures):
            notice(f"wrote {path}")
    if as_json:
        print_json(measured.found)
        return
    print_rows(_rows(measured.found), as_json=False)


def _rows(found: dict[str, Any]) -> list[dict[str, Any]]:
    """Measures beside those of real clips, or of the last pose held."""
    held, recognised, near = found["zero_velocity"], found["recognised"] or {}, found["nearest_real"]
    rows: list[tuple[str, Any, Any, str]] = [
        (f"error at {time} ms, mm", error, held["errors_ms"][time], "last pose held")
        for time, error in found["errors_ms"].items()
    ]
    rows += [
        (f"{title}, mm", found[name], held[name], "last pose held")
        for name, title in (("mean_per_joint_error", "mean per-joint error"), ("euclidean", "Euclidean distance"))
    ]
    rows += [
        ("FID", found["fid"], found["fid_real"], "training against test clips"),
        ("FID, seeds of other classes", found["fid_other_seeds"], found["fid_real"], "training against test clips"),
    ]
    rows += [
        (title, found[name]["made"], found[name]["real"], "real clips")
        for name, title in (
            ("foot_sliding", "foot sliding, m/s"), ("energy", "energy, m²/s²"), ("travel_speed", "travel speed, m/s"),
        )
    ]  # fmt: skip
    rows += [
        ("bone-length drift, %", found["bone_length_drift"], None, ""),
        ("class recognised, seeds of other classes", recognised.get("made"), recognised.get("real"), "real clips"),
    ]
    if near:
        rows.append(
            (
                "nearest training clip, median, body lengths",
                near["made"]["median"],
                near["test"]["median"],
                "real clips",
            )
        )
    return [{"measure": a, "made": b, "beside": c, "beside is": d} for a, b, c, d in rows]

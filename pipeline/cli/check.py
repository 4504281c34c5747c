"""motionlake check and clean: what in recordings no body did, and copies in which that is mended."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from motionlake import sql
from motionlake.cli._output import check_folder_of, notice, tell
from motionlake.cli.common import (
    PATHS,
    ClipsArgument,
    DatasetOption,
    JsonOption,
    LakeOption,
    argument,
    named_source,
    option,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, reading
from motionlake.lake.layout import Lake, open_lake
from motionlake.names import file_name, json_text, told_apart

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion
    from motionlake.motion.quality import Quality
    from motionlake.motion.quality.mend import Mended
    from motionlake.motion.quality_config import QualityConfig

MOST_TOLD: Final = 5  # faults of a kind and clip in the table; JSON has them all
MOST_NAMED: Final = 3  # clips of which one line tells


@dataclass(frozen=True)
class _Checked:
    name: str
    motion: CanonicalMotion | None  # where it is to be drawn
    quality: Quality
    outstanding: Quality  # without what is usual in its dataset


def check(
    lake: LakeOption,
    clips: ClipsArgument = None,
    dataset: DatasetOption = None,
    picture: Annotated[
        Path | None,
        option("--picture", help="Also draw the worst clips and their faults into this .png or .html file."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """What is wrong with recordings, worst first; exit status 1 where a clip is bad, else 0.

    Without names all clips of the lake, or of a dataset, are checked. Thresholds stand in config.toml, table [quality].
    Once the stage quality has run, a fault that half of a dataset's clips have is told once for the dataset, and of a
    clip only where it stands out there; --json tells all.

    Example: motionlake check walk_01 --lake mylake

    A file that is not in the lake: motionlake check shots/new_take.bvh --picture faults.png --lake mylake

    All clips of a dataset: motionlake check --dataset hdm05 --json --lake mylake
    """
    target = open_lake(lake)
    if picture is not None:
        if picture.suffix not in (".png", ".html"):
            raise UserError(f"--picture {picture}: its name must end in .png or .html")
        check_folder_of(picture)
    if clips and dataset is not None:
        raise UserError("--dataset: is for a check without names")
    with reading(target) as con:
        found = list(_checked(con, target, clips, dataset, drawn=picture is not None))
        _tell_usual(con, {one.name for one in found})
    _tell_in_place(found)
    found.sort(key=_badness)
    if picture is not None:
        _draw(picture, found)
    tell([_as_row(one) for one in found], [row for one in found for row in _table(one)], as_json=as_json)
    bad = sum(one.outstanding.verdict == "bad" for one in found)
    if bad:
        notice(f"{bad} of {len(found)} clips {'is' if bad == 1 else 'are'} bad")
        raise typer.Exit(1)


def clean(
    lake: LakeOption,
    clips: Annotated[list[str], argument(f"Clips of the lake, or clip files; {PATHS}.")],
    out: Annotated[Path, option("--out", "-o", help="Folder for the mended copies, which is made.")],
    as_json: JsonOption = False,
) -> None:
    """Write mended copies of clips as BVH, and beside each what was mended where.

    Clips stay as they are. T-poses at the ends are cut off, spikes and flips filled from the frames around, jitter is
    smoothed, feet that slide are pinned to the ground and bodies that sink raised to it, where nothing jumps by it.
    Other faults stay, and are told; exit status 1 where a copy is still bad. Copies have the canonical skeleton with
    the body's own bone lengths.

    Example: motionlake clean walk_01 --out mended --lake mylake
    """
    from motionlake.motion.quality import sentence

    target = open_lake(lake)
    with reading(target) as con:
        found = list(_checked(con, target, clips, None, drawn=True))
    names = told_apart((one.name for one in found), lambda name: file_name(Path(name).name.rpartition(".")[0] or name))
    rows, left = [], False
    for one in found:
        file, done, after = _mend(target, one, out / f"{names[one.name]}.bvh")
        rows.append(
            {
                "clip": one.name, "file": str(file), "mended": len(done), "verdict": after.verdict,
                "left": "; ".join(sentence(fault, after.fps) for fault in after.faults),
            }
        )  # fmt: skip
        left = left or after.verdict == "bad"
    tell(rows, as_json=as_json)
    if left:
        notice("what is still bad cannot be mended here")
        raise typer.Exit(1)


def _mend(lake: Lake, one: _Checked, file: Path) -> tuple[Path, list[Mended], Quality]:
    from motionlake.formats.write.bvh import write_bvh
    from motionlake.lake.parts import replacing
    from motionlake.motion.canonicalise import to_source_clip
    from motionlake.motion.quality import Recording, sentence
    from motionlake.motion.quality import check as checked
    from motionlake.motion.quality.mend import mended

    assert one.motion is not None
    if file.exists():
        raise UserError(f"{file}: is there already; say with --out another folder")
    try:
        copy, done = mended(one.motion, one.quality.faults)
    except ValueError as error:
        raise UserError(f"{one.name}: {error}") from error
    recording = Recording.of(copy.positions, copy.rotations, copy.fps, twist=copy.twist, filled=copy.filled)
    after = checked(recording, _config(lake))
    lineage = {
        "source": one.name, "frames": one.quality.frames, "fps": one.quality.fps, "verdict": one.quality.verdict,
        "mended": [each.as_row() for each in done], "verdict_after": after.verdict,
        "left": [{**fault.as_row(), "says": sentence(fault, after.fps)} for fault in after.faults],
    }  # fmt: skip
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_bvh(to_source_clip(copy), file)
        with replacing(file.with_suffix(".json")) as temporary:
            temporary.write_text(json_text(lineage) + "\n", encoding="utf-8")
    except OSError as error:
        raise UserError(f"{file}: cannot be written ({error.strerror or error})") from error
    return file, done, after


def _config(lake: Lake) -> QualityConfig:
    from motionlake.lake.config import load_config
    from motionlake.motion.quality_config import QualityConfig

    return load_config(lake.config_file).of(QualityConfig)


def _checked(
    con: Connection, lake: Lake, names: list[str] | None, dataset: str | None, *, drawn: bool
) -> Iterator[_Checked]:
    from motionlake.lake.frames import canonical_motion
    from motionlake.motion.quality import Recording, in_dataset
    from motionlake.motion.quality import check as checked
    from motionlake.stages.frames import first_body

    config = _config(lake)
    usual = _usual(con)
    every = sorted(row["clip"] for row in fetch(con, "clips_of_dataset", {"dataset": dataset})) if not names else []
    sources = [named_source(con, name) for name in names] if names else every
    for source in sources:
        if isinstance(source, Path):
            clip, motion = first_body(lake, source)
            repaired, of = clip.repaired, ""
        else:
            motion = canonical_motion(con, lake, source)
            row = fetch(con, "clip", {"clip": source})[0]
            repaired, of = row["repaired"], row["dataset"]
        recording = Recording.of(
            motion.positions, motion.rotations, motion.fps, twist=motion.twist, filled=motion.filled, repaired=repaired
        )
        quality = checked(recording, config)
        outstanding = in_dataset(quality, usual.get(of, {}), config)
        yield _Checked(str(source), motion if drawn else None, quality, outstanding)


def _knows_usual(con: Connection) -> bool:
    return bool(con.execute(sql.read("has_view"), {"view": "quality_usual"}).fetchall()[0][0])


def _usual(con: Connection) -> dict[str, dict[str, dict[str, float]]]:
    """By dataset, fault and joint, above which multiple of its threshold what is usual there stands out; nothing where
    the stage has not run."""
    if not _knows_usual(con):
        return {}
    found: dict[str, dict[str, dict[str, float]]] = {}
    for row in fetch(con, "usual_limits"):
        found.setdefault(row["dataset"], {}).setdefault(row["fault"], {})[row["joint"]] = row["highest"]
    return found


def _tell_usual(con: Connection, names: set[str]) -> None:
    """What is usual in the datasets of clips that were checked."""
    for row in fetch(con, "usual_summary", {"clips": sorted(names)}) if _knows_usual(con) else ():
        fault, share = row["fault"].replace("_", " "), f"{row['faulty']} of {row['clips']} clips"
        notice(
            f"{row['dataset']}: {fault} is usual here, in {share}, median {row['median']:.1f} times the threshold; "
            "only what stands out is told of its clips"
        )


def _tell_in_place(found: list[_Checked]) -> None:
    """Which clips walk on a ground that moves under them."""
    every = [(one.name, speed) for one in found if (speed := one.quality.measures["in_place"])]
    if every:
        shown = ", ".join(f"{name} ({speed:.2f} m/s)" for name, speed in every[:MOST_NAMED])
        more = f" and {len(every) - MOST_NAMED} more" if len(every) > MOST_NAMED else ""
        notice(f"on a treadmill, or with their way taken out: {shown}{more}; that is no slide")


def _badness(one: _Checked) -> tuple[int, int, float, str]:
    from motionlake.motion.quality import VERDICTS

    worst = [-VERDICTS.index(each.verdict) for each in (one.outstanding, one.quality)]
    return worst[0], worst[1], -one.outstanding.share, one.name


def _draw(path: Path, found: list[_Checked]) -> None:
    from motionlake.pictures.faults import MOST_CLIPS, CheckedClip, fault_bands
    from motionlake.pictures.html import page, picture, write_file
    from motionlake.pictures.style import png

    drawn = [CheckedClip(one.name, one.motion, one.outstanding) for one in found[:MOST_CLIPS] if one.motion is not None]
    if len(found) > MOST_CLIPS:
        notice(f"{path}: the worst {MOST_CLIPS} of {len(found)} clips are drawn")
    figure = fault_bands(drawn, "Faults of recordings", "the worst clips first; the body at the worst frame")
    if path.suffix == ".png":
        write_file(path, png(figure))
        return
    tables = [[row for one in found for row in _table(one)]]
    one = picture("faults", "Faults of recordings", "Bands show where each fault is; the body its worst frame.", figure)
    write_file(path, page("Faults of recordings", [], tables, {"Where": [one]}).encode(errors="replace"))


def _as_row(one: _Checked) -> dict[str, Any]:
    from motionlake.motion.quality import sentence

    quality = one.quality
    faults, outstanding = (
        [{**fault.as_row(), "says": sentence(fault, quality.fps)} for fault in each.faults]
        for each in (quality, one.outstanding)
    )
    return {
        "clip": one.name, "verdict": quality.verdict, "verdict_in_dataset": one.outstanding.verdict,
        "frames": quality.frames, "fps": quality.fps, "measures": dict(quality.measures), "faults": faults,
        "outstanding": outstanding,
    }  # fmt: skip


def _table(one: _Checked) -> list[dict[str, Any]]:
    """A row a fault, the worst of each kind; one without any of a clip that is ok."""
    from motionlake.motion.quality import KINDS, sentence

    quality, rows = one.outstanding, []
    for kind in KINDS:
        faults = [fault for fault in quality.faults if fault.kind == kind]
        told = sorted(sorted(faults, key=lambda fault: -fault.severity)[:MOST_TOLD], key=lambda fault: fault.start)
        rows += [sentence(fault, quality.fps) for fault in told]
        if len(faults) > len(told):
            rows.append(f"and {len(faults) - len(told)} more of {kind.replace('_', ' ')} (--json tells all)")
    verdicts = {"verdict": one.quality.verdict, "in_dataset": quality.verdict}
    return [{"clip": one.name, **verdicts, "fault": row} for row in rows or [""]]

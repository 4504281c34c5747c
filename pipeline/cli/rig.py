"""motionlake rig: which joint of a clip file is which."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from motionlake.cli._output import check_folder_of, notice, tell
from motionlake.cli.common import JsonOption, option
from motionlake.errors import ClipError, UserError

if TYPE_CHECKING:
    from motionlake.motion.auto_rig import RigMatch
    from motionlake.motion.clip import SolvedMotion, SourceClip
    from motionlake.motion.rig_joints import RigJoint
    from motionlake.motion.rigs import RigMap


def rig(
    clip: Annotated[Path | None, typer.Argument(help="A clip file; without one, the known rigs.")] = None,
    lake: Annotated[Path | None, typer.Option("--lake", "-l", help="Also the rig maps of this lake.")] = None,
    starter: Annotated[bool, typer.Option("--starter", help="Print a rig map to edit even for a known rig.")] = False,
    picture: Annotated[
        Path | None,
        option("--picture", help="Draw the skeleton, each joint named, into this .png or .html file."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Which rig a clip file has, and a rig map to edit for a rig that is not known.

    A rig map says which of the file's joints are hips, knees and so on; put it into the folder rigs/ of the lake.

    Example: motionlake rig shots/take.bvh > mylake/rigs/studio.toml

    What is what, and how sure that is: motionlake rig shots/take.bvh --picture skeleton.png

    Example: motionlake rig
    """
    from motionlake.formats import read_clips
    from motionlake.lake.config import load_config
    from motionlake.motion.auto_rig import first_map, match_rig
    from motionlake.motion.kinematics import solve
    from motionlake.motion.rigs import identify, load_rigs, placeable
    from motionlake.motion.rigs_config import RigsConfig

    rigs = load_rigs(lake / "rigs" if lake else None)
    if clip is None:
        if picture is not None:
            raise UserError("--picture: name the clip file whose skeleton is to be drawn")
        tell([{"rig": r.name, "description": r.description} for r in rigs.values()], as_json=as_json)
        return
    if picture is not None:
        if picture.suffix not in (".png", ".html"):
            raise UserError(f"--picture {picture}: its name must end in .png or .html")
        check_folder_of(picture)
    try:
        source = read_clips(clip)[0]
    except ClipError as error:
        raise UserError(f"{clip}: {error}") from error
    motion = solve(source)
    known, match = None, None
    if not starter:
        with suppress(ClipError):
            known = identify(source.hierarchy.joints, placeable(source.hierarchy, rigs))
    if known is None:
        config = load_config(lake / "config.toml") if lake else None
        match = match_rig(source.hierarchy, motion, config.of(RigsConfig) if config else RigsConfig())
    joints = _joints(source, known, match)
    name = known.name if known else _name(source, match)
    if picture is not None:
        _draw(picture, clip.name, (source, motion), name, joints, match.doubt if match else "")
        notice(f"{picture}: the skeleton of {clip.name}")
    if as_json:
        tell(_as_json(name, joints, match), as_json=True)
    elif known is not None:
        tell({"rig": name}, f"{name}: {known.description}", as_json=False)
    elif picture is None:
        print(first_map(source.hierarchy, motion))


def _name(source: SourceClip, match: RigMatch | None) -> str | None:
    from motionlake.motion.auto_rig import solved_map

    return solved_map(source.hierarchy, match).name if match and not match.doubt else None


def _joints(source: SourceClip, known: RigMap | None, match: RigMatch | None) -> list[RigJoint]:
    from motionlake.motion.rig_joints import joints_of, rig_joints

    names = source.hierarchy.joints
    return rig_joints(names, known) if known else joints_of(names, match.joints if match else {}, match)


def _as_json(name: str | None, joints: list[RigJoint], match: RigMatch | None) -> dict[str, Any]:
    """The rig of a file; without one ("rig" is null) what its tree gives, and why that is no rig."""
    found = [joint for joint in joints if joint.joint is not None]
    lacking = [joint.canonical for joint in joints if joint.joint is None]
    return {
        "rig": name,
        "joints": [asdict(joint) for joint in found if joint.canonical is not None],
        "filled": lacking if name else [],
        "missing": [] if name else lacking,
        "unmatched": [joint.joint for joint in found if joint.canonical is None],
        "sides": round(match.sides, 3) if match and match.joints else None,
        "doubt": (match.doubt or None) if match else None,
    }


def _draw(
    path: Path, file: str, body: tuple[SourceClip, SolvedMotion], name: str | None, joints: list[RigJoint], doubt: str
) -> None:
    import numpy as np
    from motionlake.motion.canonicalise import turn_to_y_up
    from motionlake.motion.kinematics import with_end_sites
    from motionlake.motion.rotations import conjugate, rotate
    from motionlake.pictures.html import page, picture, write_file
    from motionlake.pictures.skeleton import DrawnSkeleton, seen_from, skeleton_figure
    from motionlake.pictures.style import png

    source, motion = body
    names = source.hierarchy.joints
    places = {joint: at for at, joint in enumerate(names)}
    found = {j.canonical: places[j.joint] for j in joints if j.joint is not None and j.canonical is not None}
    positions, parents = with_end_sites(source.hierarchy, motion)
    # What is no person is drawn as it stands in the file.
    up = np.array(rotate(conjugate(turn_to_y_up(source.up or "y")), np.array([0.0, 1.0, 0.0]))) if doubt else None
    front, side, seen = seen_from(positions, found, up)
    unnamed = [None] * (len(parents) - len(names))
    drawn = DrawnSkeleton([*names, *unnamed], parents, front, side, seen, joints)
    said = f"rig {name}" if name else "no rig"
    note = f"{said}; {len(found)} of {len(names)} joints {'look like' if doubt else 'are'} canonical ones"
    figure = skeleton_figure(drawn, f"Skeleton of {file}", note, doubt)
    if path.suffix == ".png":
        write_file(path, png(figure))
        return
    rows = [{**asdict(joint), "evidence": _words(joint)} for joint in joints]
    one = picture("skeleton", f"Skeleton of {file}", "Which joint is which, and how sure that is.", figure)
    lead = [note, *([f"Not solved: {doubt}"] if doubt else [])]
    write_file(path, page(f"Skeleton of {file}", lead, [rows], {"Skeleton": [one]}).encode(errors="replace"))


def _words(joint: RigJoint) -> str:
    return ", ".join(f"{kind} {value:+.2f}" for kind, value in joint.evidence.items())

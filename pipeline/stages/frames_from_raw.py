"""Canonical frames from the raw blocks of a part, for a lake whose source files are gone."""

from __future__ import annotations

from motionlake.errors import UserError
from motionlake.lake.catalog import fetch
from motionlake.lake.frames import SCHEMA, Frames, RigsFooter, footer_clip, motion_footer, to_table
from motionlake.lake.parts import PartWriter, replacing
from motionlake.lake.raw import own_rig
from motionlake.motion.rigs import load_rigs
from motionlake.motion.rigs_config import RigsConfig
from motionlake.stages.reader import LakeReader


def raw_blocks(at: LakeReader, part: str) -> list[str]:
    """The raw blocks that hold the clips of a frames part, relative to the lake; none for clips without."""
    rows = fetch(at.con, "clip_rows_of_part", {"part": part})
    return sorted({at.lake.raw_part(row["layout"], part) for row in rows})


def write_frames_from_raw(at: LakeReader, dataset: str, part: str, key: str) -> str:
    """Write a frames part again from its raw blocks; returns its name.

    Raw channels are kept rounded: no joint is further from where it was than a ten-thousandth of the body's height.

    Raises:
        DamagedError: a raw block is not as it was written.
        UserError: a rig is not known any more.
    """
    from motionlake.motion.auto_rig import PREFIX, match_rig, solved_map
    from motionlake.motion.canonicalise import canonicalise
    from motionlake.motion.kinematics import solve
    from motionlake.motion.rig_joints import rig_joints

    known, config, every = load_rigs(at.lake.rigs), at.config.frames, RigsConfig(least_confidence=0.0)
    name, footer, rigs = at.lake.frames_part(dataset, part), {}, RigsFooter()
    with replacing(at.lake.path(name)) as temporary:
        writer = PartWriter(temporary, SCHEMA, {"key": key})
        for row in fetch(at.con, "clip_rows_of_part", {"part": part}):
            clip = own_rig(at.con, at.lake, row["clip"])
            solved = solve(clip)
            match = match_rig(clip.hierarchy, solved, every) if row["rig"].startswith(PREFIX) else None
            rig = solved_map(clip.hierarchy, match) if match and not match.doubt else known.get(row["rig"])
            if rig is None or rig.name != row["rig"]:
                raise UserError(f"rig {row['rig']}: there is no such map any more; put it back into {at.lake.rigs}")
            motion = canonicalise(clip, solved, rig, up=row["up"], metres_per_unit=row["metres_per_unit"])
            found = Frames(row["clip"], row["fps"], motion.rotations, motion.positions)
            writer.append(to_table(found, part, config.position_step, config.rotation_step))
            rigs.add(row["clip"], rig.name, rig_joints(clip.hierarchy.joints, rig, match))
            footer[row["clip"]] = footer_clip(row["fps"], row["rest_offsets"])
        writer.close({**motion_footer(footer), **rigs.metadata()})
    return name

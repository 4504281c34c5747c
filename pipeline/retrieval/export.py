"""Clips of a lake on their way out: cut, on a rig of the user's choice, at a rate."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.errors import ClipError, UserError
from motionlake.formats import read_clips
from motionlake.formats.write.registry import ClipToWrite
from motionlake.lake import raw
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.citations import Source, citations
from motionlake.lake.frames import canonical_motion, frame_range
from motionlake.lake.layout import Lake
from motionlake.motion.auto_rig import auto_rig, rig_of
from motionlake.motion.canonicalise import METRES_PER_UNIT, CanonicalMotion, to_source_clip
from motionlake.motion.character import Character, character_of, leg_length, zero_clip
from motionlake.motion.clip import ChannelKind, Hierarchy, SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.posing import posed, relative_places, resampled
from motionlake.motion.rest import bind, standing_rest
from motionlake.motion.retarget import retarget, t_pose
from motionlake.motion.rigs import load_rigs
from motionlake.motion.standing import foot_height
from motionlake.retrieval.selection import ClipRange

OWN, CANONICAL = "own", "canonical"
# Skeletons by name: the module of this program that has one, where it does, and the function that gives it.
_NAMED: Final = {"smpl": ("motionlake.motion.smpl", "smpl_hierarchy")}
# What a manifest says of a clip as the lake has it.
_FACTS: Final = ("dataset", "path", "content_hash", "label", "subject", "licence")


def named_skeletons() -> list[str]:
    """The names of skeletons that this program has of its own, beside the canonical one."""
    return [name for name, (module, _) in _NAMED.items() if find_spec(module) is not None]


def named_skeleton(name: str) -> Hierarchy:
    """A skeleton of this program by its name, one of `named_skeletons`; its rig map has the same name."""
    module, function = _NAMED[name]
    hierarchy: Hierarchy = getattr(importlib.import_module(module), function)()
    return hierarchy


@dataclass(frozen=True)
class Target:
    """What clips are put on.

    Attributes:
        name: own, canonical, a named skeleton, or the file of the character, as a manifest has it.
        character: whom a motion is retargeted to; None where clips stay as they are, or become canonical.
    """

    name: str
    character: Character | None = None


def target_of(lake: Lake, rig: str) -> Target:
    """What `--rig` means: own, canonical, a named skeleton, or a clip file of a character.

    Raises:
        UserError: it means nothing, or the file holds no character that motion can be put on.
    """
    if rig in (OWN, CANONICAL):
        return Target(rig)
    rigs, path = load_rigs(lake.rigs), Path(rig)
    try:
        if rig in named_skeletons():
            return Target(rig, character_of(zero_clip(named_skeleton(rig)), rigs[rig]))
        if not path.is_file():
            named = "".join(f", {name}" for name in named_skeletons())
            raise UserError(
                f"--rig {rig}: use own or canonical{named}, or a clip file of your character, such as x.bvh"
            )
        clip = read_clips(path)[0]
        return Target(path.name, character_of(clip, rig_of(clip, solve(clip), rigs)))
    except ClipError as error:
        raise UserError(f"--rig {rig}: no motion can be put on it: {error}") from error


@dataclass(frozen=True)
class Treatment:
    """What is done to clips before they are written.

    Attributes:
        target: whom they are put on.
        fps: the rate that they get; None: their own.
        tpose: whether a frame of T-pose comes first.
        as_is: the rig whose clips with rotations are not put on the target, since the format does that itself.
    """

    target: Target
    fps: float | None = None
    tpose: bool = False
    as_is: str = ""


class ClipExporter:
    """Makes clips ready to be written, one after another."""

    def __init__(self, con: Connection, lake: Lake, treatment: Treatment) -> None:
        self._con, self._lake, self._treatment = con, lake, treatment
        self._rigs = load_rigs(lake.rigs)
        self._characters: dict[tuple[str, str, str], Character | None] = {}

    def ready(self, chosen: ClipRange) -> ClipToWrite:
        """A clip, or a range of it, as it is to be written; `facts` say what it is and what was done to it.

        Raises:
            ClipError: it cannot be put on the rig.
            UserError: it has no such frames, or files of the lake are damaged.
        """
        row = fetch(self._con, "clip", {"clip": chosen.clip})[0]
        target = self._treatment.target
        done: list[dict[str, Any]] = []
        start, stop = frame_range(chosen.clip, chosen.start, chosen.stop, row["frames"])
        own = target.name == OWN or (row["rig"] == self._treatment.as_is and self._turns_from_rest(row))
        if own:
            clip, up, unit = raw.own_rig(self._con, self._lake, chosen.clip), row["up"], row["metres_per_unit"]
            clip = replace(clip, channels=clip.channels[start:stop])
            rig = row["rig"]
        else:
            motion = canonical_motion(self._con, self._lake, chosen.clip)[start:stop]
            clip, up, unit, rig, done = self._retargeted(row, motion)
        if self._treatment.fps is not None and self._treatment.fps != clip.fps:
            done.append({"resampled_from": clip.fps})
            clip = resampled(clip, self._treatment.fps)
        if self._treatment.tpose:
            done.append({"t_pose": "first frame"})
            clip = self._with_t_pose(row, clip, own=own)
        facts = {name: row[name] for name in _FACTS}
        facts |= {"start": start, "stop": stop, "rig": rig, "transforms": done}
        return ClipToWrite(chosen.clip, clip, unit, up, facts)

    def sources(self) -> dict[str, tuple[Source, ...]]:
        """Where the clips of each dataset come from: licence and citation, as `motionlake cite` has them."""
        return citations(self._con)

    def _retargeted(
        self, row: Mapping[str, Any], motion: CanonicalMotion
    ) -> tuple[SourceClip, str, float, str, list[dict[str, Any]]]:
        """The clip, its up axis and unit, the rig, and what was done."""
        step: dict[str, Any] = {"retargeted_from": row["rig"], "to": self._treatment.target.name}
        character = self._treatment.target.character
        if character is None:
            return to_source_clip(motion), "y", METRES_PER_UNIT, CANONICAL, [step]
        clip = retarget(motion, character, self._source(row))
        step |= {"scale": leg_length(character.rest_offsets) / leg_length(motion.rest_offsets), "feet": "pinned"}
        return clip, character.up, character.metres_per_unit, character.rig, [step]

    def _turns_from_rest(self, row: Mapping[str, Any]) -> bool:
        """Whether a clip's joints turn, counted from a zero pose in which the body stands."""
        if row["twist"]:
            return True
        clip = raw.own_rig(self._con, self._lake, row["clip"])
        if clip.hierarchy.kind is ChannelKind.POSITIONS:
            return False
        binding = bind(self._rigs[row["rig"]], clip.hierarchy)
        return standing_rest(binding, solve(clip), row["metres_per_unit"]) is not None

    def _source(self, row: Mapping[str, Any]) -> Character | None:
        """The character that a clip was recorded on; None where its file has only positions, or tells none."""
        key = (row["rig"], row["layout"], row["skeleton"])
        if key not in self._characters:
            self._characters[key] = self._read_source(row)
        return self._characters[key]

    def _read_source(self, row: Mapping[str, Any]) -> Character | None:
        clip = raw.own_rig(self._con, self._lake, row["clip"])
        if clip.hierarchy.kind is ChannelKind.POSITIONS:
            return None
        try:
            rig = self._rigs.get(row["rig"]) or auto_rig(clip.hierarchy, solve(clip))
            return character_of(clip, rig, up=row["up"], metres_per_unit=row["metres_per_unit"])
        except ClipError:
            return None

    def _with_t_pose(self, row: Mapping[str, Any], clip: SourceClip, *, own: bool) -> SourceClip:
        """A clip, on its own rig or another, with a frame of T-pose before it."""
        motion = canonical_motion(self._con, self._lake, row["clip"])
        name, character = self._treatment.target.name, self._treatment.target.character
        if own:
            character = self._source(row)
        elif name == CANONICAL:
            character = character_of(to_source_clip(motion), self._rigs[CANONICAL])
        if character is None:
            raise ClipError("has no T-pose in its own rig: its joints do not turn, or its rest pose is not known")
        scale = leg_length(character.rest_offsets) / leg_length(motion.rest_offsets)
        place = motion.root[0] * scale
        place[1] = foot_height(motion) * scale
        local = solve(clip).local
        assert local is not None
        first = t_pose(character, place, clip.fps)
        rest = posed(clip.hierarchy, local, relative_places(clip), clip.fps)
        return replace(rest, channels=np.vstack([first.channels, rest.channels]))

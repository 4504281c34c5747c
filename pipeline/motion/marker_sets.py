"""Marker sets: which markers on the skin make which joint centre, as data (one TOML file a set)."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.rigs import MAX_LISTED
from motionlake.motion.unmarked import Axes, with_unmarked

# The joints of the rig `markers`.
JOINT_CENTRES: Final = (
    "hip_centre", "neck_centre", "head_centre",
    "left_shoulder_centre", "left_elbow_centre", "left_wrist_centre",
    "right_shoulder_centre", "right_elbow_centre", "right_wrist_centre",
    "left_hip_centre", "left_knee_centre", "left_ankle_centre", "left_toe_end",
    "right_hip_centre", "right_knee_centre", "right_ankle_centre", "right_toe_end",
)  # fmt: skip
HEAD: Final = "head_centre"
NECK: Final = "neck_centre"
ARMS: Final = ("left_elbow_centre", "left_wrist_centre", "right_elbow_centre", "right_wrist_centre")
_SHOULDERS: Final = ("left_shoulder_centre", "right_shoulder_centre")
JOINT_CENTRE_PARENTS: Final = (-1, 0, 1, 1, 3, 4, 1, 6, 7, 0, 9, 10, 11, 0, 13, 14, 15)


@dataclass(frozen=True)
class Pelvis:
    """Markers of the pelvis: the front spines of both sides, and those at its back, whose mean is taken."""

    left_front: str
    right_front: str
    back: tuple[str, ...]


@dataclass(frozen=True)
class Chest:
    """Markers at the back and at the front of the chest, which say where it faces; the neck has them too."""

    back: tuple[str, ...]
    front: tuple[str, ...]


@dataclass(frozen=True)
class MarkerSet:
    """A way to place markers.

    Attributes:
        name, description, source: what it is called, what it is, where its names come from.
        joints: joint centre -> markers, of which it is the mean. The head may lack; where there is a pelvis, the arms,
            and with them the shoulders, and with them the neck.
        pelvis: its markers, from which the centres of the hips follow where they are not among `joints`.
        chest: markers that say where the chest faces; None where the shoulders do.
        centres: whether its points are joint centres that a program has computed, rather than places on the skin.
    """

    name: str
    description: str
    source: str
    joints: Mapping[str, tuple[str, ...]]
    pelvis: Pelvis | None = None
    chest: Chest | None = None
    centres: bool = False

    @property
    def unmarked(self) -> tuple[str, ...]:
        """The `JOINT_CENTRES` that no marker of it places."""
        return tuple(joint for joint in (NECK, HEAD, *_SHOULDERS, *ARMS) if joint not in self.joints)

    @property
    def required(self) -> tuple[str, ...]:
        """Markers that a file of this set must have."""
        pelvis = self.pelvis
        of_pelvis = () if pelvis is None else (pelvis.left_front, pelvis.right_front, *pelvis.back)
        of_joints = (marker for markers in self.joints.values() for marker in markers)
        return tuple(dict.fromkeys((*of_pelvis, *of_joints)))

    def of_file(self, markers: Collection[str]) -> MarkerSet | None:
        """The set without those parts of the upper body that the file leaves out; None where it has markers of a part
        that the set does not know.

        Left out are a head without any marker, arms without any marker and, where the arms are, shoulders and a neck
        that lack one. So a whole body that lacks some markers is never taken for legs.
        """
        there = {marker.casefold() for marker in markers}

        def has(joint: str, of: Mapping[str, Collection[str]], count: Callable[[Iterable[bool]], bool]) -> bool:
            return count(marker.casefold() in there for marker in of.get(joint, ()))

        if self.pelvis is None:
            return self
        left_out = set() if has(HEAD, self.joints, any) else {HEAD}
        if not any(has(joint, _markers_of_arms(), any) for joint in ARMS):
            left_out |= {*ARMS, *(() if all(has(one, self.joints, all) for one in _SHOULDERS) else _SHOULDERS)}
            if HEAD in left_out and not has(NECK, self.joints, all):
                left_out |= {NECK, *_SHOULDERS}
        elif any(joint not in self.joints for joint in ARMS):
            return None
        kept = {joint: markers for joint, markers in self.joints.items() if joint not in left_out}
        if len(kept) == len(self.joints):
            return self
        return replace(self, joints=kept, chest=self.chest if NECK in kept else None)

    def lacking(self, markers: Collection[str]) -> list[str]:
        """Required markers that are not among these; letter case does not matter."""
        there = {marker.casefold() for marker in markers}
        return [marker for marker in self.required if marker.casefold() not in there]


@functools.cache
def marker_sets() -> tuple[MarkerSet, ...]:
    """The marker sets of the package, in the order of their names."""
    folder = resources.files("motionlake.motion").joinpath("marker_sets")
    texts = [file.read_text(encoding="utf-8") for file in folder.iterdir() if file.name.endswith(".toml")]
    return tuple(sorted((_parse(text) for text in texts), key=lambda marker_set: marker_set.name))


@functools.cache
def _markers_of_arms() -> Mapping[str, frozenset[str]]:
    """Joint centre of the arms -> markers that any set puts there."""
    return {joint: frozenset(m for one in marker_sets() for m in one.joints.get(joint, ())) for joint in ARMS}


def _parse(text: str) -> MarkerSet:
    table = tomllib.loads(text)
    pelvis, chest = table.get("pelvis"), table.get("chest")
    return MarkerSet(
        name=table["name"],
        description=table["description"],
        source=table["source"],
        joints={joint: tuple(markers) for joint, markers in table["joints"].items()},
        pelvis=None if pelvis is None else Pelvis(pelvis["left_front"], pelvis["right_front"], tuple(pelvis["back"])),
        chest=None if chest is None else Chest(tuple(chest["back"]), tuple(chest["front"])),
        centres=table.get("centres", False),
    )


def fitting_sets(markers: Collection[str]) -> list[MarkerSet]:
    """The sets of which all markers are among these, without the parts of the body that the file leaves out.

    The best comes first: the one that places most of the body, then of joint centres, then of more markers. The others
    place as much of the body as it, but perhaps the head.

    Raises:
        ClipError: none fits; the reason names the nearest one and the markers that the file lacks, if it has any.
    """
    sets = [one for one in (marker_set.of_file(markers) for marker_set in marker_sets()) if one is not None]
    fitting = [marker_set for marker_set in sets if not marker_set.lacking(markers)]
    if fitting:
        fitting.sort(key=lambda one: (len(one.unmarked), not one.centres, -len(one.required)))
        return [one for one in fitting if set(one.unmarked) <= {HEAD, *fitting[0].unmarked}]
    nearest = min(sets, key=lambda marker_set: len(marker_set.lacking(markers)) / len(marker_set.required))
    lacking = nearest.lacking(markers)
    if len(lacking) == len(nearest.required):
        shown = ", ".join(list(markers)[:3])
        raise ClipError(f"its markers fit no marker set: none has any of its {len(markers)} points ({shown}, …)")
    more = f" and {len(lacking) - MAX_LISTED} more" if len(lacking) > MAX_LISTED else ""
    raise ClipError(
        f"its markers fit no marker set; the nearest, {nearest.name}, lacks {', '.join(lacking[:MAX_LISTED])}{more}"
    )


def joint_centres(marker_set: MarkerSet, positions: Float64Array, markers: Sequence[str]) -> Float64Array:
    """[F, 17, 3] the `JOINT_CENTRES`, metres, in the axes of the markers; those that are `unmarked` are made up.

    Args:
        marker_set: one that fits the markers.
        positions: [F, M, 3] of the markers, metres, finite.
        markers: their M names.

    Raises:
        ClipError: the markers of the pelvis are in one line, or those of the legs are no person's.
    """
    place = {marker.casefold(): index for index, marker in enumerate(markers)}

    def mean(names: Sequence[str]) -> Float64Array:
        return np.asarray(sum(positions[:, place[name.casefold()]] for name in names) / len(names))

    centres = {joint: mean(names) for joint, names in marker_set.joints.items()}
    pelvis, chest, axes = marker_set.pelvis, marker_set.chest, None
    if pelvis is not None:
        left, right, back = mean([pelvis.left_front]), mean([pelvis.right_front]), mean(pelvis.back)
        axes = _pelvis_axes(left, right, back)
        if "left_hip_centre" not in centres:
            centres["left_hip_centre"], centres["right_hip_centre"] = hip_centres(left, right, back)
    centres["hip_centre"] = 0.5 * (centres["left_hip_centre"] + centres["right_hip_centre"])
    whole = with_unmarked(centres, axes, None if chest is None else mean(chest.front) - mean(chest.back))
    return np.stack([whole[joint] for joint in JOINT_CENTRES], axis=1)


def _pelvis_axes(left_front: Float64Array, right_front: Float64Array, back: Float64Array) -> Axes:
    return Axes.of(right_front - left_front, 0.5 * (left_front + right_front) - back, "pelvis")


def hip_centres(
    left_front: Float64Array, right_front: Float64Array, back: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """The left and the right hip [F, 3] from the front spines of the pelvis and the middle of its back [F, 3], metres.

    M. Harrington et al., "Prediction of the hip joint centre in adults, children, and patients with cerebral palsy
    based on magnetic resonance imaging" (2007): by the width and depth of the pelvis, here their means over the clip.

    Raises:
        ClipError: the markers are in one line, in some frame.
    """
    middle = 0.5 * (left_front + right_front)
    width = float(np.linalg.norm(right_front - left_front, axis=1).mean())
    depth = float(np.linalg.norm(middle - back, axis=1).mean())
    axes = _pelvis_axes(left_front, right_front, back)
    origin = middle + (-0.24 * depth - 0.0099) * axes.ahead + (-0.30 * width - 0.0109) * axes.up
    aside = (0.33 * width + 0.0073) * axes.right
    return origin - aside, origin + aside

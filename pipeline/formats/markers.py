"""Clips of joints from the markers, or points called as joints, of a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.repair import fill_missing, missing_samples, repair_note
from motionlake.motion.clip import Hierarchy, SourceClip
from motionlake.motion.marker_sets import (
    ARMS,
    HEAD,
    JOINT_CENTRE_PARENTS,
    JOINT_CENTRES,
    NECK,
    MarkerSet,
    fitting_sets,
    joint_centres,
)
from motionlake.motion.named_joints import NamedTree, named_tree
from motionlake.motion.upright import up_of_body

ARMLESS = "no marker on the arms: they hang"
NECKLESS = "no markers that place the neck: the trunk goes on straight from the pelvis"
HEADLESS = "no marker on the head: it goes on where the trunk points"


def clips_of_markers(
    positions: Float64Array, markers: Sequence[str], fps: float, *, up: str | None = None, tell_up: bool = False
) -> list[SourceClip]:
    """One clip of joints for every subject (`SUBJECT:MARKER`) whose markers fit a set, or are called as a rig's joints.

    Markers that the set does not name are left out; gaps of others are interpolated.

    Args:
        positions: [F, M, 3] of the markers, metres; not finite or all zero where a marker was not seen.
        markers: their M names.
        fps: frames a second.
        up: the up axis that the file declares.
        tell_up: where it declares none, tell it by the body, with a note.

    Raises:
        ClipError: no subject's markers fit a set, or one was seen too seldom.
    """

    def clip(places: dict[str, int], subject: str) -> SourceClip:
        told = _clip(positions, places, fps, tell_up and up is None)
        who = (f"subject {subject}",) if subject else ()
        return replace(told, up=told.up if up is None else up, notes=(*who, *told.notes))

    return clips_of_subjects(markers, clip)


def clips_of_subjects(names: Sequence[str], read: Callable[[dict[str, int], str], SourceClip]) -> list[SourceClip]:
    """One clip for every subject of names `SUBJECT:NAME`, numbered where there are several.

    Args:
        names: of what the file holds.
        read: makes a clip of a subject's names, each with its place, and of what the subject is called.

    Raises:
        ClipError: as `read` raises it for the subject of the most names, where it does so for all.
    """
    subjects: dict[str, dict[str, int]] = {}
    for index, each in enumerate(names):
        subject, _, name = each.rpartition(":")
        subjects.setdefault(subject, {}).setdefault(name, index)
    clips, refused = [], []
    for subject, places in subjects.items():
        try:
            clips.append(read(places, subject))
        except ClipError as error:
            refused.append((len(places), subject, error))
    if not clips:
        raise max(refused, key=lambda one: one[0])[2]
    left_out = tuple(f"subject {subject or '(no name)'} left out: {why.reason}" for _, subject, why in refused)
    return [
        replace(clip, body=str(number) if len(clips) > 1 else "", notes=(*clip.notes, *left_out))
        for number, clip in enumerate(clips, start=1)
    ]


def _clip(positions: Float64Array, places: dict[str, int], fps: float, tell_up: bool) -> SourceClip:
    """Of the first set that fits and of which every marker was seen, else of the rig whose joints the names are.

    Before a set that makes up arms comes such a rig, too.
    """
    try:
        fitting = fitting_sets(places)
    except ClipError:
        tree = named_tree(tuple(places))
        if tree is None:
            raise
    else:
        tree = named_tree(tuple(places)) if ARMS[0] in fitting[0].unmarked else None
    if tree is not None:
        return _clip_of_joints(positions, places, tree, fps, tell_up)
    for marker_set in fitting[:-1]:
        try:
            return _clip_of_set(positions, places, marker_set, fps, tell_up)
        except ClipError:
            continue  # a marker that another set does not need was seen too seldom
    return _clip_of_set(positions, places, fitting[-1], fps, tell_up)


def _clip_of_set(
    positions: Float64Array, places: dict[str, int], marker_set: MarkerSet, fps: float, tell_up: bool
) -> SourceClip:
    wanted = {name.casefold() for name in marker_set.required}
    names = [name for name in places if name.casefold() in wanted]
    seen = np.take(positions, [places[name] for name in names], axis=1)
    filled, repaired = fill_missing(seen, missing_samples(seen), names)
    joints = joint_centres(marker_set, filled, names)
    up = _up_of_centres(joints, marker_set.unmarked) if tell_up else None
    made_up = {HEAD: HEADLESS, NECK: NECKLESS, ARMS[0]: ARMLESS}
    return SourceClip(
        hierarchy=Hierarchy.of_positions(JOINT_CENTRES, JOINT_CENTRE_PARENTS),
        channels=joints.reshape(len(joints), -1),
        fps=fps,
        metres_per_unit=1.0,
        up=up,
        repaired=repaired,
        filled=marker_set.unmarked,
        notes=(
            f"joints from markers: {marker_set.name}",
            *(note for joint, note in made_up.items() if joint in marker_set.unmarked),
            *up_note(up),
            *repair_note(repaired, len(joints)),
        ),
    )


def _up_of_centres(joints: Float64Array, unmarked: Sequence[str]) -> str | None:
    centre = {name: joints[:, joint] for joint, name in enumerate(JOINT_CENTRES)}
    top = next(name for name in (HEAD, NECK, "hip_centre") if name not in unmarked)
    return up_of_body(centre[top], (centre["left_ankle_centre"] + centre["right_ankle_centre"]) / 2)


def _clip_of_joints(
    positions: Float64Array, places: dict[str, int], tree: NamedTree, fps: float, tell_up: bool
) -> SourceClip:
    every = tuple(places)
    names = tuple(every[place] for place in tree.places)
    seen = positions[:, [places[name] for name in names]]
    filled, repaired = fill_missing(seen, missing_samples(seen), names)
    up = up_of_tree(tree, filled) if tell_up else None
    return SourceClip(
        hierarchy=Hierarchy.of_positions(names, tree.parents),
        channels=filled.reshape(len(filled), -1),
        fps=fps,
        metres_per_unit=1.0,
        up=up,
        repaired=repaired,
        notes=(f"points are joints: {tree.rig}", *up_note(up), *repair_note(repaired, len(filled))),
    )


def up_of_tree(tree: NamedTree, positions: Float64Array) -> str | None:
    """The up axis by a body whose joints [F, J, 3] are those of a tree; None where it does not tell."""
    top = tree.canonical.get("head", tree.canonical.get("neck"))
    feet = [tree.canonical[joint] for joint in ("left_ankle", "right_ankle") if joint in tree.canonical]
    if top is None or not feet:
        return None
    return up_of_body(positions[:, top], np.asarray(positions[:, feet].mean(axis=1)))


def up_note(up: str | None) -> tuple[str, ...]:
    """That the body told which way is up, where it did."""
    return (f"up is {up}, by the body",) if up else ()

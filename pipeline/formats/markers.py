"""Clips of joints from the markers of a file."""

from __future__ import annotations

from collections.abc import Sequence

from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.repair import fill_missing, missing_samples, repair_note
from motionlake.motion.clip import Hierarchy, SourceClip
from motionlake.motion.marker_sets import JOINT_CENTRE_PARENTS, JOINT_CENTRES, fitting_set, joint_centres


def clips_of_markers(positions: Float64Array, markers: Sequence[str], fps: float) -> list[SourceClip]:
    """One clip of joints for every subject (`SUBJECT:MARKER`) whose markers fit a set.

    Markers that the set does not name are left out; gaps of others are interpolated.

    Args:
        positions: [F, M, 3] of the markers, metres; not finite or all zero where a marker was not seen.
        markers: their M names.
        fps: frames a second.

    Raises:
        ClipError: no subject's markers fit a set, or one was seen too seldom.
    """
    subjects: dict[str, dict[str, int]] = {}
    for index, marker in enumerate(markers):
        subject, _, name = marker.rpartition(":")
        subjects.setdefault(subject, {}).setdefault(name, index)
    clips, refused = [], []
    for subject, places in subjects.items():
        try:
            clips.append(_clip(positions, places, fps, subject))
        except ClipError as error:
            refused.append((len(places), subject, error))
    if not clips:
        raise max(refused, key=lambda one: one[0])[2]
    left_out = tuple(f"subject {subject or '(no name)'} left out: {why.reason}" for _, subject, why in refused)
    return [
        SourceClip(
            clip.hierarchy,
            clip.channels,
            clip.fps,
            body=str(number) if len(clips) > 1 else "",
            metres_per_unit=1.0,
            repaired=clip.repaired,
            notes=(*clip.notes, *left_out),
        )
        for number, clip in enumerate(clips, start=1)
    ]


def _clip(positions: Float64Array, places: dict[str, int], fps: float, subject: str) -> SourceClip:
    marker_set = fitting_set(places)
    wanted = {name.casefold() for name in marker_set.required}
    names = [name for name in places if name.casefold() in wanted]
    seen = positions[:, [places[name] for name in names]]
    filled, repaired = fill_missing(seen, missing_samples(seen), names)
    joints = joint_centres(marker_set, filled, names)
    who = (f"subject {subject}",) if subject else ()
    return SourceClip(
        hierarchy=Hierarchy.of_positions(JOINT_CENTRES, JOINT_CENTRE_PARENTS),
        channels=joints.reshape(len(joints), -1),
        fps=fps,
        repaired=repaired,
        notes=(*who, f"joints from markers: {marker_set.name}", *repair_note(repaired, len(joints))),
    )

"""Writing clips as HumanML3D has them: joints, features, captions, and the mean and deviation to standardise by."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.errors import ClipError
from motionlake.formats.write.joints import joint_places
from motionlake.formats.write.registry import ClipToWrite
from motionlake.formats.write.stems import clip_stem
from motionlake.formats.write.whole import whole_file
from motionlake.motion.humanml3d import FEATURES, FPS, GROUPS, bones_of_joints, features, placed, recovered_joints
from motionlake.motion.kinematics import world_rotations
from motionlake.motion.rigs import joints_by_name
from motionlake.motion.rotations import multiply, rotate
from motionlake.motion.skeleton import chained
from motionlake.motion.smpl import BODY_JOINTS, JOINTS, OFFSETS, PARENTS
from motionlake.motion.smpl_motion import on_mean_body
from motionlake.names import folded

JOINTS_FOLDER, FEATURES_FOLDER, TEXTS_FOLDER = "new_joints", "new_joint_vecs", "texts"
# What loaders of the dataset look a word's vector up by: the word and its part of speech.
_NO_PART_OF_SPEECH: Final = "OTHER"


@dataclass
class _Set:
    """What the set holds so far; sums are over all frames."""

    names: list[str] = field(default_factory=list)
    taken: set[str] = field(default_factory=set)
    frames: int = 0
    total: Float64Array = field(default_factory=lambda: np.zeros(FEATURES))
    squares: Float64Array = field(default_factory=lambda: np.zeros(FEATURES))


@dataclass(frozen=True)
class HumanML3DWriter:
    """HumanML3D's folders of the bodies' joints, features and captions.

    Attributes:
        twist: whether the features' rotations hold turns about bones, which the published program leaves out.
    """

    name: str
    twist: bool
    rig: str = "smpl"
    fps: float = FPS

    def write_all(self, motions: Iterable[ClipToWrite], folder: Path) -> list[tuple[int, ClipError]]:
        """Write the set into a folder.

        Raises:
            ClipError: no clip could be written.
        """
        made, left_out = _Set(), []
        for name in (JOINTS_FOLDER, FEATURES_FOLDER, TEXTS_FOLDER):
            (folder / name).mkdir()
        for number, motion in enumerate(motions):
            try:
                rows = humanml3d_features(motion, twist=self.twist).astype(np.float32)
            except ClipError as error:
                left_out.append((number, error))
                continue
            name = _free_name(made, motion.name)
            _save(folder / FEATURES_FOLDER / f"{name}.npy", rows)
            joints = recovered_joints(rows.astype(np.float64))[0][:-1]
            _save(folder / JOINTS_FOLDER / f"{name}.npy", joints.astype(np.float32))
            _write_caption(folder / TEXTS_FOLDER / f"{name}.txt", motion)
            _enter(made, name, rows)
        if not made.names:
            raise ClipError(f"no clip could be written: {left_out[0][1]}" if left_out else "there is no clip to write")
        mean, deviation = _statistics(made)
        _save(folder / "Mean.npy", mean)
        _save(folder / "Std.npy", deviation)
        with whole_file(folder / "all.txt") as stream:
            stream.writelines(f"{name}\n".encode() for name in made.names)
        return left_out


def humanml3d_features(motion: ClipToWrite, *, twist: bool) -> Float64Array:
    """[F - 1, 263] features of a clip on SMPL's skeleton.

    With `twist` it is put on the mean body, and rotations are those of its joints; without, its bones stay as they are,
    and rotations are the smallest that explain where joints are, as in the dataset.

    Raises:
        ClipError: the clip is no motion of the SMPL skeleton, or has fewer than two frames.
    """
    if len(motion.clip.channels) < 2:
        raise ClipError("has one frame, and features are of the way to the next")
    if not twist:
        names = joints_by_name(motion.clip.hierarchy.joints)
        if missing := [name for name in JOINTS[:BODY_JOINTS] if name not in names]:
            raise ClipError(f"is no motion of the SMPL skeleton: it has no joint {missing[0]}")
        return features(placed(joint_places(motion)[:, [names[name] for name in JOINTS[:BODY_JOINTS]]])[0])
    body, parents = on_mean_body(motion.clip, motion.metres_per_unit, motion.up), PARENTS[:BODY_JOINTS]
    world = world_rotations(body.rotations[:, :BODY_JOINTS], parents)
    bones = rotate(world[:, [max(parent, 0) for parent in parents]], OFFSETS[:BODY_JOINTS])
    bones[:, 0] = body.root
    positions, turn = placed(chained(bones, parents))
    return features(positions, bones_of_joints(multiply(turn, world)))


def _free_name(made: _Set, clip: str) -> str:
    """The name of a clip's files, which no other of the set has on any file system."""
    stem = clip_stem(clip)
    names = itertools.chain([stem], (f"{stem}-{number}" for number in itertools.count(2)))
    return next(name for name in names if folded(name) not in made.taken)


def _write_caption(path: Path, motion: ClipToWrite) -> None:
    """A line as the dataset has it: caption, words with their parts of speech, and 0 to 0 s, which means all of it."""
    caption = " ".join(str(motion.facts.get("label") or "").replace("#", " ").replace("_", " ").split())
    words = re.findall(r"[^\W_]+", caption.lower())
    if words:
        with whole_file(path) as stream:
            tokens = " ".join(f"{word}/{_NO_PART_OF_SPEECH}" for word in words)
            stream.write(f"{caption}#{tokens}#0.0#0.0\n".encode())


def _enter(made: _Set, name: str, rows: Float32Array) -> None:
    made.names.append(name)
    made.taken.add(folded(name))
    made.frames += len(rows)
    made.total += rows.sum(axis=0, dtype=np.float64)
    made.squares += (rows.astype(np.float64) ** 2).sum(axis=0)


def _statistics(made: _Set) -> tuple[Float32Array, Float32Array]:
    """[263] the mean of every number, and its deviation, of which all numbers of one kind have the mean one."""
    mean = made.total / made.frames
    deviation = np.sqrt(np.maximum(made.squares / made.frames - mean**2, 0.0))
    for group in GROUPS:
        deviation[group] = deviation[group].mean()
    return mean.astype(np.float32), deviation.astype(np.float32)


def _save(path: Path, array: Float32Array) -> None:
    with whole_file(path) as stream:
        np.save(stream, array, allow_pickle=False)


WRITER: Final = HumanML3DWriter("humanml3d", twist=False)

"""Made bodies in the joint trees of rigs of which there are no recordings, walking on the spot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.clip import ChannelKind, Hierarchy, SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import from_axis_angle, to_euler

FRAMES = 40
_ROTATIONS = ("Zrotation", "Yrotation", "Xrotation")
# From the joint before it in metres: y up, z to where the body faces, x to the left.
_TOE, _SHIN, _THIGH, _HIP = (0.0, -0.05, 0.13), (0.0, -0.4, -0.01), (0.0, -0.41, 0.01), (0.09, -0.05, 0.0)
_CLAVICLE, _SHOULDER, _UPPER, _LOWER = (0.03, 0.1, 0.0), (0.14, 0.02, 0.0), (0.28, 0.0, 0.0), (0.25, 0.0, 0.0)

Offset = tuple[float, float, float]


@dataclass(frozen=True)
class Names:
    """The names of a rig's joints, as its maker publishes its tree.

    Attributes:
        above: joints above the hips.
        hips, trunk, neck, head: from the hips up; arms hang on the last of `trunk`, the head on the last of `neck`.
        legs: what carries both legs below the hips, "" where they hang there.
        arm, leg: joints from the body outwards; "+NAME" is a twist joint beside the next one, "=NAME" one on the way,
            and "NAME~END" has END after its side.
        fingers: first joints of fingers and how many follow; "{}" is where their number stands.
        sides: how names of the left and of the right are formed.
        helpers: joints of the root that belong to no body, each with its children.
        shoulder: of a body without collar bones, where the left arm begins from the last of `trunk`.
        positions: whether its files hold positions in place of rotations.
        rig: the map that these names are of, "" where it is called as the body is.
    """

    hips: str
    trunk: tuple[str, ...]
    neck: tuple[str, ...]
    head: str
    arm: tuple[str, ...]
    leg: tuple[str, ...]
    fingers: tuple[str, ...]
    sides: tuple[str, str]
    above: tuple[str, ...] = ()
    legs: str = ""
    face: tuple[str, ...] = ()
    helpers: tuple[tuple[str, tuple[str, ...]], ...] = ()
    shoulder: Offset | None = None
    positions: bool = False
    rig: str = ""


_LEFT_RIGHT = ("Left{}", "Right{}")
_RIGIFY_FINGERS = tuple(f"{finger}.{{}}" for finger in ("thumb", "f_index", "f_middle", "f_ring", "f_pinky"))
_HANDS = tuple(f"Hand{finger}{{}}" for finger in ("Thumb", "Index", "Middle", "Ring", "Pinky"))


def _rigify(prefix: str, arm: tuple[str, ...], leg: tuple[str, ...]) -> Names:
    spine = [f"{prefix}spine.00{i}" for i in range(1, 7)]
    sides = (f"{prefix}{{}}.L", f"{prefix}{{}}.R")
    return Names(f"{prefix}spine", tuple(spine[:3]), tuple(spine[3:5]), spine[5], arm, leg, _RIGIFY_FINGERS, sides)


_RIGIFY_TURNED_ARM = ("shoulder", "upper_arm", "=upper_arm~.001", "forearm", "=forearm~.001", "hand")
_RIGIFY_TURNED_LEG = ("thigh", "=thigh~.001", "shin", "=shin~.001", "foot", "toe")
_RIGIFY_ARM, _RIGIFY_LEG = ("shoulder", "upper_arm", "forearm", "hand"), ("thigh", "shin", "foot", "toe")
RIGS = {
    "soma": Names("Hips", ("Spine1", "Spine2", "Chest"), ("Neck1", "Neck2"), "Head",
                  ("Shoulder", "Arm", "ForeArm", "Hand"), ("Leg", "Shin", "Foot", "ToeBase"), _HANDS, _LEFT_RIGHT,
                  above=("Root",), face=("Jaw", "LeftEye", "RightEye", "HeadEnd")),
    "smplx": Names("pelvis", ("spine1", "spine2", "spine3"), ("neck",), "head",
                   ("collar", "shoulder", "elbow", "wrist"), ("hip", "knee", "ankle", "foot"),
                   ("index{}", "middle{}", "pinky{}", "ring{}", "thumb{}"), ("left_{}", "right_{}"),
                   face=("jaw", "left_eye_smplhf", "right_eye_smplhf")),
    "perception_neuron": Names("Hips", ("Spine", "Spine1", "Spine2", "Spine3"), ("Neck",), "Head",
                               ("Shoulder", "Arm", "ForeArm", "Hand"), ("UpLeg", "Leg", "Foot"), _HANDS, _LEFT_RIGHT),
    "daz": Names("hip", ("abdomenLower", "abdomenUpper", "chestLower", "chestUpper"), ("neckLower", "neckUpper"),
                 "head", ("Collar", "ShldrBend", "=ShldrTwist", "ForearmBend", "=ForearmTwist", "Hand"),
                 ("ThighBend", "=ThighTwist", "Shin", "Foot", "=Metatarsals", "Toe"),
                 ("Thumb{}", "Index{}", "Mid{}", "Ring{}", "Pinky{}"), ("l{}", "r{}"), legs="pelvis",
                 face=("lEye", "rEye")),
    "unreal": Names("pelvis", ("spine_01", "spine_02", "spine_03"), ("neck_01",), "head",
                    ("clavicle", "upperarm", "+upperarm_twist_01", "lowerarm", "+lowerarm_twist_01", "hand"),
                    ("thigh", "+thigh_twist_01", "calf", "+calf_twist_01", "foot", "ball"),
                    ("thumb_0{}", "index_0{}", "middle_0{}", "ring_0{}", "pinky_0{}"), ("{}_l", "{}_r"),
                    above=("root",), helpers=(("ik_foot_root", ("ik_foot_l", "ik_foot_r")),
                                              ("ik_hand_root", ("ik_hand_gun", "ik_hand_l", "ik_hand_r")))),
    "unity": Names("Hips", ("Spine", "Chest"), ("Neck",), "Head",
                   ("Shoulder", "UpperArm", "LowerArm", "Hand"), ("UpperLeg", "LowerLeg", "Foot", "Toes"), (),
                   _LEFT_RIGHT),
    "rigify": _rigify("", _RIGIFY_ARM, _RIGIFY_LEG),
    "rigify_org": _rigify("ORG-", _RIGIFY_ARM, _RIGIFY_LEG),
    "rigify_def": _rigify("DEF-", _RIGIFY_TURNED_ARM, _RIGIFY_TURNED_LEG),
    "rokoko": Names("Hips", ("Spine1", "Spine2", "Spine3", "Spine4"), ("Neck",), "Head",
                    ("Shoulder", "Arm", "ForeArm", "Hand"), ("Thigh", "Shin", "Foot", "Toe"),
                    tuple(f"Finger{i}{{}}" for i in range(1, 6)), _LEFT_RIGHT, above=("Root",)),
    "humanik": Names("Hips", ("Spine", "Spine1", "Spine2"), ("Neck",), "Head",
                     ("Shoulder", "Arm", "+ArmRoll", "ForeArm", "+ForeArmRoll", "Hand"),
                     ("UpLeg", "+UpLegRoll", "Leg", "+LegRoll", "Foot", "ToeBase"), _HANDS, _LEFT_RIGHT,
                     above=("Reference",), rig="mixamo"),
    "motive": Names("Hip", ("Ab", "Chest"), ("Neck",), "Head", ("Shoulder", "UArm", "FArm", "Hand"),
                    ("Thigh", "Shin", "Foot", "Toe"), ("Thumb{}", "Index{}", "Middle{}", "Ring{}", "Pinky{}"),
                    ("L{}", "R{}")),
    "opensim": Names("pelvis", ("torso",), ("neck",), "head", ("humerus", "ulna", "=radius", "hand"),
                     ("femur", "tibia", "talus", "=calcn", "toes"), (), ("{}_l", "{}_r"), shoulder=(0.17, 0.12, 0.0)),
    "canonical": Names("hips", ("spine", "chest"), ("neck",), "head", ("clavicle", "shoulder", "elbow", "wrist"),
                       ("hip", "knee", "ankle", "toe"), (), ("left_{}", "right_{}")),
    "deepmimic": Names("root", ("chest",), ("neck",), "", ("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"), (),
                       ("left_{}", "right_{}"), shoulder=(0.18, 0.24, 0.0)),
    "kinect_v2": Names("SpineBase", ("SpineMid", "SpineShoulder"), ("Neck",), "Head",
                       ("Shoulder", "Elbow", "Wrist", "Hand", "HandTip"), ("Hip", "Knee", "Ankle", "Foot"), (),
                       ("{}Left", "{}Right"), shoulder=(0.17, -0.03, 0.0), positions=True),
    "markers": Names("hip_centre", ("neck_centre",), (), "head_centre",
                     ("shoulder_centre", "elbow_centre", "wrist_centre"),
                     ("hip_centre", "knee_centre", "ankle_centre", "toe_end"), (), ("left_{}", "right_{}"),
                     shoulder=(0.17, -0.03, 0.0), positions=True),
    "mixamo": Names("Hips", ("Spine", "Spine1", "Spine2"), ("Neck",), "Head",
                    ("Shoulder", "Arm", "ForeArm", "Hand"), ("UpLeg", "Leg", "Foot", "ToeBase"), _HANDS, _LEFT_RIGHT,
                    face=("HeadTop_End",)),
    "biped": Names("Bip01 Pelvis", ("Bip01 Spine", "Bip01 Spine1", "Bip01 Spine2"), ("Bip01 Neck",), "Bip01 Head",
                   ("Clavicle", "UpperArm", "Forearm", "Hand"), ("Thigh", "Calf", "Foot", "Toe0"),
                   ("Finger0{}", "Finger1{}", "Finger2{}", "Finger3{}", "Finger4{}"), ("Bip01 L {}", "Bip01 R {}"),
                   above=("Bip01",), face=("Bip01 HeadNub",)),
    "xsens": Names("Hips", ("Chest", "Chest2", "Chest3", "Chest4"), ("Neck",), "Head",
                   ("Collar", "Shoulder", "Elbow", "Wrist"), ("Hip", "Knee", "Ankle", "Toe"), (), _LEFT_RIGHT),
    "smpl": Names("pelvis", ("spine1", "spine2", "spine3"), ("neck",), "head",
                  ("collar", "shoulder", "elbow", "wrist", "hand"), ("hip", "knee", "ankle", "foot"), (),
                  ("left_{}", "right_{}")),
    "lafan1": Names("Hips", ("Spine", "Spine1", "Spine2"), ("Neck",), "Head",
                    ("Shoulder", "Arm", "ForeArm", "Hand"), ("UpLeg", "Leg", "Foot", "Toe"), (), _LEFT_RIGHT),
}  # fmt: skip


class _Tree:
    def __init__(self) -> None:
        self.names: list[str] = []
        self.parents: list[int] = []
        self.offsets: list[Offset] = []
        self.tips: list[tuple[int, Offset]] = []
        self.swings: dict[int, tuple[tuple[float, float, float], float, float, float]] = {}

    def add(self, name: str, parent: int, offset: Offset) -> int:
        self.names.append(name)
        self.parents.append(parent)
        self.offsets.append(offset)
        return len(self.names) - 1

    def limb(self, names: tuple[str, ...], start: int, offsets: list[Offset], form: str) -> list[int]:
        """Joints of a limb; one that a name marks lies beside the next bone, or half way along it.

        An offset that is left ends the last bone.
        """
        found, parent, waiting = [], start, iter(offsets)
        offset: Offset | None = None
        for name in names:
            offset = offset or next(waiting, (offsets[-1][0] / 3, offsets[-1][1], offsets[-1][2] / 3))
            if name[0] in "+=":
                half = (offset[0] / 2, offset[1] / 2, offset[2] / 2)
                middle, _, end = name[1:].partition("~")
                place = self.add(form.format(middle) + end, parent, half)
                if name[0] == "=":
                    parent, offset = place, half
                continue
            parent = self.add(form.format(name), parent, offset)
            found.append(parent)
            offset = None
        self.tips += [(parent, tip) for tip in waiting]
        return found


def walker(rig: str) -> SourceClip:
    """A body of a rig's joints that swings its legs and arms, knees and elbows bent as a person's."""
    names, tree, root = RIGS[rig], _Tree(), -1
    for name in names.above:
        root = tree.add(name, root, (0.0, 0.0, 0.0))
    hips = tree.add(names.hips, root, (0.0, 0.95, 0.0))
    carrier = tree.add(names.legs, hips, (0.0, -0.01, 0.0)) if names.legs else hips
    for side, x, phase in ((0, 1.0, 0.0), (1, -1.0, np.pi)):
        offsets = [(a * x, b, c) for a, b, c in (_HIP, _THIGH, _SHIN, _TOE)]
        hip, knee, *_ = tree.limb(names.leg, carrier, offsets, names.sides[side])
        tree.swings[hip] = ((1.0, 0.0, 0.0), -5.0, 25.0, phase)
        tree.swings[knee] = ((1.0, 0.0, 0.0), 25.0, 20.0, phase + 1.5)
    chest = hips
    for name in names.trunk:
        chest = tree.add(name, chest, (0.0, 0.4 / len(names.trunk), 0.0))
    top = chest
    for i, name in enumerate(names.neck):
        top = tree.add(name, top, (0.0, 0.05, 0.01) if i else (0.0, 0.14, 0.0))
    if names.head:
        top = tree.add(names.head, top, (0.0, 0.09, 0.02))
    else:
        tree.tips.append((top, (0.0, 0.18, 0.02)))
    for i, name in enumerate(names.face):
        tree.add(name, top, (0.03 * (i - 1), 0.06, 0.08))
    for side, x, phase in ((0, 1.0, np.pi), (1, -1.0, 0.0)):
        form = names.sides[side]
        first = (names.shoulder,) if names.shoulder else (_CLAVICLE, _SHOULDER)
        offsets = [(a * x, b, c) for a, b, c in (*first, _UPPER, _LOWER)]
        shoulder, elbow, *hand = tree.limb(names.arm, chest, offsets, form)[len(first) - 1 :]
        tree.swings[shoulder] = ((0.0, 0.0, 1.0), -70.0 * x, 8.0, phase)
        tree.swings[elbow] = ((0.0, 1.0, 0.0), -25.0 * x, 15.0, phase)
        for i, finger in enumerate(names.fingers):
            last = hand[0]
            for number in range(1, 4):
                offset = (0.025 * x, 0.0, 0.0) if number > 1 else (0.09 * x, 0.0, 0.03 - 0.02 * i)
                last = tree.add(form.format(finger.format(number)), last, offset)
    for name, children in names.helpers:
        helper = tree.add(name, 0, (0.0, 0.0, 0.0))
        for i, child in enumerate(children):
            tree.add(child, helper, (0.1 * (i - 1), 0.05, 0.0))
    clip = _moving(tree)
    return _of_positions(clip) if names.positions else clip


def _moving(tree: _Tree) -> SourceClip:
    count = len(tree.names)
    hierarchy = Hierarchy(
        tuple(tree.names), tuple(tree.parents), np.array(tree.offsets), (_ROTATIONS,) * count, ChannelKind.EULER,
        np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), end_sites=tuple(tree.tips),
    )  # fmt: skip
    time = np.linspace(0, 4 * np.pi, FRAMES)
    angles: Float64Array = np.zeros((FRAMES, count, 3))
    for joint, (axis, mean, swing, phase) in tree.swings.items():
        turns = [from_axis_angle(np.array(axis), mean + swing * float(np.sin(t + phase))) for t in time]
        angles[:, joint] = to_euler(np.stack(turns), "ZYX")
    return SourceClip(hierarchy, angles.reshape(FRAMES, -1), 30.0)


def _of_positions(clip: SourceClip) -> SourceClip:
    hierarchy = Hierarchy.of_positions(clip.hierarchy.joints, clip.hierarchy.parents)
    return SourceClip(hierarchy, solve(clip).positions.reshape(FRAMES, -1), clip.fps)

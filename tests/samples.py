"""Writers of small clips in every format that the readers read; each as the format's own tools print it."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.formats import read_clips
from motionlake.formats.write.glb import glb_bytes
from motionlake.formats.write.registry import ClipToWrite

KINECT_1 = (
    "HipCenter", "Spine", "ShoulderCenter", "Head", "ShoulderLeft", "ElbowLeft", "WristLeft", "HandLeft",
    "ShoulderRight", "ElbowRight", "WristRight", "HandRight", "HipLeft", "KneeLeft", "AnkleLeft", "FootLeft",
    "HipRight", "KneeRight", "AnkleRight", "FootRight",
)  # fmt: skip
KINECT_1_PARENTS = (-1, 0, 1, 2, 2, 4, 5, 6, 2, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18)
FLAT = (-1, *[0] * 19)


def kinect_2_from_1(positions: Float64Array) -> Float64Array:
    """[F, 25, 3] in the order of NTU files, from the 20 joints of a Kinect v1: shared joints as they are."""
    joint = {name: positions[:, index] for index, name in enumerate(KINECT_1)}
    neck = 0.7 * joint["ShoulderCenter"] + 0.3 * joint["Head"]
    body = [joint["HipCenter"], joint["Spine"], neck, joint["Head"]]
    limbs = [joint[name] for name in KINECT_1[4:]]
    hands = []
    for side in ("Left", "Right"):
        hand, wrist = joint[f"Hand{side}"], joint[f"Wrist{side}"]
        hands += [hand + 0.5 * (hand - wrist), wrist + 0.4 * (hand - wrist) + [0.0, 0.0, -0.03]]
    return np.stack([*body, *limbs, joint["ShoulderCenter"], *hands], axis=1)


def ntu_text(
    bodies: Sequence[tuple[str, int, Float64Array]],
    *,
    dropped: frozenset[tuple[int, int]] = frozenset(),
    untracked: frozenset[tuple[int, int, int]] = frozenset(),
    newline: str = "\n",
) -> str:
    """An NTU RGB+D file.

    Args:
        bodies: (body ID, first frame, positions [F, 25, 3]) of everyone in the file.
        dropped: (body, frame of the file) where the body is not listed.
        untracked: (body, frame of the file, joint) with tracking state 0.
        newline: the end of each line.
    """
    frame_count = max(first + len(positions) for _, first, positions in bodies)
    lines = [str(frame_count)]
    for frame in range(frame_count):
        present = [
            (index, name, positions[frame - first])
            for index, (name, first, positions) in enumerate(bodies)
            if first <= frame < first + len(positions) and (index, frame) not in dropped
        ]
        lines.append(str(len(present)))
        for index, name, pose in present:
            lines += [f"{name} 0 1 1 1 1 0 -0.0274631 0.1234567 2", "25"]
            for joint, (x, y, z) in enumerate(pose):
                state = 0 if (index, frame, joint) in untracked else 2
                pixels = f"{256 + 365 * x:.7g} {212 - 365 * y:.7g} {960 + 1050 * x:.7g} {540 - 1050 * y:.7g}"
                lines.append(f"{x:.7g} {y:.7g} {z:.7g} {pixels} 0.7071068 0 -0.7071068 1e-07 {state}")
    return newline.join(lines) + newline


def npz_bytes(positions: Float64Array, joints: Sequence[str], parents: Sequence[int], fps: float) -> bytes:
    """A positions `.npz`."""
    stream = io.BytesIO()
    np.savez_compressed(
        stream,
        positions=positions.astype(np.float32),
        joints=np.array(joints),
        parents=np.array(parents, np.int16),
        fps=np.float32(fps),
    )
    return stream.getvalue()


def deepmimic_frames(count: int) -> Float64Array:
    """[count, 44] a DeepMimic humanoid at 30 frames a second that bends knees and elbows as it moves +x."""
    frames = np.zeros((count, 44))
    phase = np.linspace(0.0, 2.0 * np.pi, count)
    frames[:, 0] = 1 / 30
    frames[:, 1] = np.linspace(0.0, 1.0, count)
    frames[:, 2] = 0.85
    frames[:, [4, 8, 12, 16, 21, 25, 30, 35, 39]] = 1.0
    frames[:, 16], frames[:, 19] = np.cos(0.2 * np.sin(phase)), np.sin(0.2 * np.sin(phase))
    frames[:, [20, 34]] = -0.5 + 0.4 * np.stack([np.sin(phase), np.cos(phase)], axis=1)
    frames[:, [29, 43]] = 0.8
    return frames


def deepmimic_text(frames: Float64Array) -> str:
    """A DeepMimic motion file."""
    rows = ",\n".join(json.dumps(frame) for frame in frames.tolist())
    return f'{{\n"Loop": "wrap",\n"Frames":\n[\n{rows}\n]\n}}\n'


def swinging_body(count: int) -> Float64Array:
    """[count, 20, 3] a made-up Kinect v1 body three metres from the sensor, arms swinging."""
    spine, arm, leg = (0.0, 0.1, 0.45, 0.65), (0.4, 0.1, -0.1, -0.2), (-0.1, -0.5, -0.9, -1.0)
    up = (*spine, *arm, *arm, *leg, *leg)
    across = np.repeat([0.0, -0.25, 0.25, -0.1, 0.1], 4)
    pose = np.stack([across, up, np.full(20, 3.0)], axis=1)
    motion = np.tile(pose, (count, 1, 1))
    swing = 0.2 * np.sin(np.linspace(0.0, 6.0, count))
    motion[:, [5, 6, 7], 2] += swing[:, None]
    motion[:, [9, 10, 11], 2] -= swing[:, None]
    return motion


def mirrored_body(positions: Float64Array) -> Float64Array:
    """[F, 20, 3] joints of a Kinect v1, left for right."""
    sides = {"Left": "Right", "Right": "Left"}
    order = [
        KINECT_1.index(next((name.replace(a, b) for a, b in sides.items() if a in name), name)) for name in KINECT_1
    ]
    mirrored: Float64Array = positions[:, order] * np.array([-1.0, 1.0, 1.0])
    return mirrored


def plug_in_gait_markers(positions: Float64Array) -> tuple[list[str], Float64Array]:
    """Names of 29 markers and their places [F, 29, 3] on a Kinect v1 body [F, 20, 3] that faces -z."""
    joint = {name: positions[:, index] for index, name in enumerate(KINECT_1)}
    placed = {"C7": joint["ShoulderCenter"] + [0, 0, 0.05], "CLAV": joint["ShoulderCenter"] - [0, 0, 0.05]}
    for side, letter, out in (("Left", "L", -1.0), ("Right", "R", 1.0)):
        offsets = {
            "FHD": ("Head", (0.07, 0, -0.08)), "BHD": ("Head", (0.07, 0, 0.08)),
            "ASI": ("HipCenter", (0.12, 0.05, -0.1)), "PSI": ("HipCenter", (0.04, 0.05, 0.08)),
            "SHO": (f"Shoulder{side}", (0, 0, 0)), "ELB": (f"Elbow{side}", (0.04, 0, 0)),
            "WRA": (f"Wrist{side}", (0, 0, -0.03)), "WRB": (f"Wrist{side}", (0, 0, 0.03)),
            "KNE": (f"Knee{side}", (0.05, 0, 0)), "ANK": (f"Ankle{side}", (0.04, 0, 0)),
            "TOE": (f"Foot{side}", (0, 0, -0.15)),
        }  # fmt: skip
        for name, (of, offset) in offsets.items():
            placed[letter + name] = joint[of] + np.array(offset) * [out, 1.0, 1.0]
    return list(placed), np.stack(list(placed.values()), axis=1)


def trc_text(markers: Sequence[str], positions: Float64Array, fps: float = 100.0) -> str:
    """An OpenSim TRC in millimetres; a marker [F, M, 3] in metres is blank where it is not finite."""
    frames, count = positions.shape[:2]
    lines = [
        "PathFileType\t4\t(X/Y/Z)\tsample.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{fps:g}\t{fps:g}\t{frames}\t{count}\tmm\t{fps:g}\t1\t{frames}",
        "Frame#\tTime\t" + "\t\t\t".join(markers),
        "\t\t" + "\t".join(f"{axis}{number}" for number in range(1, count + 1) for axis in "XYZ"),
        "",
    ]
    for frame, row in enumerate(positions.reshape(frames, -1) * 1000.0):
        values = [f"{value:.5f}" if np.isfinite(value) else "" for value in row]
        lines.append("\t".join([str(frame + 1), f"{frame / fps:.5f}", *values]))
    return "\n".join(lines) + "\n"


BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0.0 0.0 0.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Chest
  {
    OFFSET 0.0 20.5 0.0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0.0 15.0 0.0
    }
  }
  JOINT LeftUpLeg
  {
    OFFSET 9.0 -5.0 0.0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0.0 -40.0 0.0
    }
  }
}
MOTION
Frames: 4
Frame Time: 0.0333333
0.0 90.0 0.0 0.0 0.0 0.0 1.0 2.0 3.0 4.0 5.0 6.0
0.5 90.5 0.1 0.0 1.0 0.0 1.5 2.0 3.0 4.0 5.5 6.0
1.0 91.0 0.2 0.0 2.0 0.0 2.0 2.0 3.0 4.0 6.0 6.0
1.5 90.5 0.3 0.0 3.0 0.0 2.5 2.0 3.0 4.0 6.5 6.0
"""

ASF = """# AST/ASF file
:version 1.10
:name sample
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
   made for tests
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name lowerback
     direction 0.0 1.0 0.0
     length 2.0
     axis 0 0 0 XYZ
     dof rx ry rz
     limits (-20.0 45.0)
            (-30.0 30.0)
            (-30.0 30.0)
  end
  begin
     id 2
     name lfemur
     direction 0.34 -0.94 0.0
     length 7.1
     axis 0 0 20 XYZ
     dof rx
     limits (-160.0 20.0)
  end
:hierarchy
  begin
    root lowerback lfemur
  end
"""
AMC = """#!OML:ASF sample.asf
:FULLY-SPECIFIED
:DEGREES
1
root 9.3 17.5 -17.2 -2.4 -2.5 -1.1
lowerback 4.1 0.5 2.1
lfemur -3.25
2
root 9.4 17.6 -17.1 -2.3 -2.4 -1.2
lowerback 4.2 0.6 2.2
lfemur -4.25
3
root 9.5 17.7 -17.0 -2.2 -2.3 -1.3
lowerback 4.3 0.7 2.3
lfemur -5.25
"""


def _text(content: Callable[[], str]) -> Callable[[Path], bytes]:
    return lambda folder: content().encode()


def _amc(folder: Path) -> bytes:
    (folder / "sample.asf").write_text(ASF, newline="\n")
    return AMC.encode()


def _scene(folder: Path) -> bytes:
    """A made-up body as a skinned .glb."""
    path = folder / "of_scene.npz"
    path.write_bytes(npz_bytes(swinging_body(12), KINECT_1, KINECT_1_PARENTS, 30.0))
    clip = read_clips(path)[0]
    path.unlink()
    return glb_bytes(ClipToWrite("sample", clip, 1.0))


def _gltf(folder: Path) -> bytes:
    """The same as JSON, and its buffer beside it."""
    data = _scene(folder)
    size = int.from_bytes(data[12:16], "little")
    document = json.loads(data[20 : 20 + size])
    document["buffers"][0]["uri"] = "sample.bin"
    (folder / "sample.bin").write_bytes(data[28 + size :])
    return json.dumps(document, indent=1).encode()


def fbx_text(frames: int = 12) -> str:
    """A chain of three bones as ASCII FBX 7.4, centimetres, z up, whose first bone moves and second turns."""
    bones, objects, links = ("Hips", "Spine", "Head"), [], []
    ticks = ",".join(str(round(frame * 46186158000 / 30)) for frame in range(frames))
    for number, name in enumerate(bones, start=1):
        place = f'P: "Lcl Translation", "Lcl Translation", "", "A",0,0,{90 if number == 1 else 30}'
        objects.append(f'NodeAttribute: {number + 10}, "NodeAttribute::", "LimbNode" {{\nTypeFlags: "Skeleton"\n}}')
        properties = f"Properties70: {{\n{place}\n}}"
        objects.append(f'Model: {number}, "Model::{name}", "LimbNode" {{\nVersion: 232\n{properties}\n}}')
        links += [f'C: "OO",{number + 10},{number}', f'C: "OO",{number},{number - 1}']
    objects.append(
        'AnimationStack: 50, "AnimStack::walk", "" {\nProperties70: {\n'
        f'P: "LocalStart", "KTime", "Time", "",0\n'
        f'P: "LocalStop", "KTime", "Time", "",{round((frames - 1) * 46186158000 / 30)}\n}}\n}}'
    )
    objects.append('AnimationLayer: 51, "AnimLayer::base", "" {\n}')
    links.append('C: "OO",51,50')
    for curve, (bone, what, axis, step) in enumerate(((1, "T", "X", 2.0), (2, "R", "Y", 3.0))):
        node, keys = 60 + curve, 70 + curve
        values = ",".join(str(step * frame) for frame in range(frames))
        held = "".join(f'P: "d|{name}", "Number", "", "A",{90 if what + name == "TZ" else 0}\n' for name in "XYZ")
        objects.append(f'AnimationCurveNode: {node}, "AnimCurveNode::{what}", "" {{\nProperties70: {{\n{held}}}\n}}')
        lists = f"KeyTime: *{frames} {{\na: {ticks}\n}}\nKeyValueFloat: *{frames} {{\na: {values}\n}}"
        flags = "KeyAttrFlags: *1 {\na: 4\n}\nKeyAttrDataFloat: *4 {\na: 0,0,0,0\n}"
        count = f"KeyAttrRefCount: *1 {{\na: {frames}\n}}"
        objects.append(f'AnimationCurve: {keys}, "AnimCurve::", "" {{\nKeyVer: 4008\n{lists}\n{flags}\n{count}\n}}')
        long = {"T": "Lcl Translation", "R": "Lcl Rotation"}[what]
        links += [f'C: "OO",{node},51', f'C: "OP",{node},{bone}, "{long}"', f'C: "OP",{keys},{node}, "d|{axis}"']
    axes = "".join(
        f'P: "{name}", "int", "Integer", "",{value}\n'
        for name, value in (("UpAxis", 2), ("UpAxisSign", 1), ("FrontAxis", 1), ("FrontAxisSign", -1),
                            ("CoordAxis", 0), ("CoordAxisSign", 1), ("TimeMode", 6))
    )  # fmt: skip
    unit = 'P: "UnitScaleFactor", "double", "Number", "",1\n'
    return (
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {\nFBXHeaderVersion: 1003\nFBXVersion: 7400\n}\n"
        f"GlobalSettings: {{\nVersion: 1000\nProperties70: {{\n{axes}{unit}}}\n}}\n"
        "Objects: {\n" + "\n".join(objects) + "\n}\nConnections: {\n" + "\n".join(links) + "\n}\n"
    )


def c3d_bytes(
    names: Sequence[str],
    positions: Float64Array,
    fps: float = 100.0,
    *,
    screen: tuple[str, str] | None = ("+X", "+Y"),
    unit: float = 0.001,
    unit_name: str = "mm",
    scale: float = -1.0,
) -> bytes:
    """A C3D as the package c3d writes it, of points [F, M, 3] in metres; one that is not finite was not seen.

    Args:
        names: of the points.
        positions: where they are.
        fps: `POINT:RATE`.
        screen: `POINT:X_SCREEN` and `Y_SCREEN`, or none of them.
        unit, unit_name: metres a unit, and its name.
        scale: of whole numbers; below zero the file has floats.
    """
    import c3d

    writer = c3d.Writer(point_rate=fps, analog_rate=0.0, point_scale=scale)
    seen = np.isfinite(positions).all(axis=2)
    points = np.zeros((*positions.shape[:2], 5), np.float32)
    points[..., :3] = np.where(seen[..., None], positions / unit, 0.0)
    points[..., 3] = np.where(seen, 0.0, -1.0)
    points[..., 4] = np.where(seen, 0.0, -1.0)
    for frame in points:
        writer.add_frames([(frame, np.zeros((0, 0)))])
    writer.set_point_labels(list(names))
    group = writer.point_group
    group.add_str("UNITS", "", unit_name, len(unit_name))
    if screen is not None:
        writer.set_screen_axis(*screen)
    stream = io.BytesIO()
    writer.write(stream)
    return stream.getvalue()


def motive_text(
    things: Sequence[tuple[str, str, str, dict[str, Float64Array]]],
    fps: float = 120.0,
    *,
    rotation: str = "Quaternion",
    unit: str = "Meters",
    parents: bool = True,
) -> str:
    """An export of OptiTrack Motive, blank where a number is not finite.

    Args:
        things: (type, name, parent, numbers) of each; numbers [F] by "Rotation X", "Position Y" and so on.
        fps: frames a second.
        rotation, unit: `Rotation Type` and `Length Units`.
        parents: whether there is a row of parents.
    """
    frames = len(next(iter(things[0][3].values())))
    settings = [
        "Format Version", "1.23", "Take Name", "Take 1", "Take Notes", "", "Capture Frame Rate", f"{fps:f}",
        "Export Frame Rate", f"{fps:f}", "Capture Start Time", "2024-05-01 10.00.00.000 AM",
        "Total Frames in Take", str(frames), "Total Exported Frames", str(frames), "Rotation Type", rotation,
        "Length Units", unit, "Coordinate Space", "Global",
    ]  # fmt: skip
    columns = [(kind, name, parent, *key.split(), values) for kind, name, parent, all_ in things
               for key, values in all_.items()]  # fmt: skip
    rows = [
        ["", "Type", *(column[0] for column in columns)],
        ["", "Name", *(column[1] for column in columns)],
        ["", "ID", *(f'"{number:X}"' for number in range(len(columns)))],
        *([["", "Parent", *(column[2] for column in columns)]] if parents else []),
        ["", "", *(column[3] for column in columns)],
        ["Frame", "Time (Seconds)", *(column[4] for column in columns)],
    ]
    lines = [",".join(settings), "", *(",".join(row) for row in rows)]
    for frame in range(frames):
        values = [f"{column[5][frame]:.6f}" if np.isfinite(column[5][frame]) else "" for column in columns]
        lines.append(",".join([str(frame), f"{frame / fps:.6f}", *values]))
    return "\n".join(lines) + "\n"


MOTIVE_BONES = {
    "Hip": ("", (0.0, 0.95, 0.0)), "Ab": ("Hip", (0.0, 0.08, 0.0)), "Chest": ("Ab", (0.0, 0.2, 0.0)),
    "Neck": ("Chest", (0.0, 0.25, 0.0)), "Head": ("Neck", (0.0, 0.12, 0.02)),
    **{f"{side}{bone}": (f"{side}{parent}" if parent[0] != "*" else parent[1:], (sign * x, y, z))
       for side, sign in (("L", 1.0), ("R", -1.0)) for bone, parent, (x, y, z) in (
        ("Shoulder", "*Chest", (0.04, 0.2, 0.0)), ("UArm", "Shoulder", (0.13, 0.0, 0.0)),
        ("FArm", "UArm", (0.29, 0.0, 0.0)), ("Hand", "FArm", (0.25, 0.0, 0.0)),
        ("Thigh", "*Hip", (0.09, -0.02, 0.0)), ("Shin", "Thigh", (0.0, -0.43, 0.0)),
        ("Foot", "Shin", (0.0, -0.42, 0.0)), ("Toe", "Foot", (0.0, -0.06, 0.13)))},
}  # fmt: skip


def motive_skeleton(
    frames: int = 12, who: str = "Bob", rotation: str = "Quaternion"
) -> list[tuple[str, str, str, dict[str, Float64Array]]]:
    """Bones of a made-up skeleton of Motive that swings arms and legs, worked out with SciPy."""
    from scipy.spatial.transform import Rotation

    phase = np.linspace(0.0, 2.0 * np.pi, frames)
    swing = {"Hip": (10.0, 20.0, 5.0), "LThigh": (-30.0, 5.0, 0.0), "RThigh": (30.0, -5.0, 3.0),
             "LShin": (40.0, 0.0, 0.0), "LUArm": (0.0, 20.0, -60.0), "RFArm": (0.0, 70.0, 10.0),
             "Neck": (0.0, 30.0, 0.0)}  # fmt: skip
    world: dict[str, tuple[Rotation, Float64Array]] = {}
    things = []
    for bone, (parent, offset) in MOTIVE_BONES.items():
        angles = np.outer(np.sin(phase), swing.get(bone, (0.0, 0.0, 0.0)))
        turn, place = Rotation.from_euler("XYZ", angles, degrees=True), np.tile(np.array(offset), (frames, 1))
        if parent:
            turn, place = world[parent][0] * turn, world[parent][1] + world[parent][0].apply(place)
        else:
            place[:, 2] += np.linspace(0.0, 0.5, frames)
        world[bone] = turn, place
        numbers = turn.as_quat() if rotation == "Quaternion" else turn.as_euler("XYZ", degrees=True)
        axes = "XYZW" if rotation == "Quaternion" else "XYZ"
        columns = {f"Rotation {axis}": numbers[:, at] for at, axis in enumerate(axes)}
        columns |= {f"Position {axis}": place[:, at] for at, axis in enumerate("XYZ")}
        things.append(("Bone", f"{who}:{who if bone == 'Hip' else bone}", f"{who}:{parent}" if parent else "", columns))
    return things


def mot_text(columns: dict[str, Float64Array], in_degrees: str | None = "yes") -> str:
    """An OpenSim motion of columns [F], the first of which is the time."""
    frames = len(next(iter(columns.values())))
    head = ["Coordinates", "version=1", f"nRows={frames}", f"nColumns={len(columns)}"]
    head += [] if in_degrees is None else [f"inDegrees={in_degrees}"]
    head += ["", "Units are S.I. units (second, meters, Newtons, ...)", "", "endheader", "\t".join(columns)]
    rows = ["\t".join(f"{value:16.8f}" for value in row) for row in np.column_stack(list(columns.values()))]
    return "\n".join([*head, *rows]) + "\n"


def walking_angles(frames: int = 12, fps: float = 100.0) -> dict[str, Float64Array]:
    """Coordinates of an OpenSim gait model that walks along x, degrees and metres; arms and trunk move."""
    time = np.arange(frames) / fps
    phase = 2.0 * np.pi * time
    one, two = np.sin(phase), np.sin(phase + np.pi)
    columns = {"time": time, "pelvis_tilt": 5.0 + one, "pelvis_list": 2.0 * two, "pelvis_rotation": 4.0 * one}
    columns |= {"pelvis_tx": 1.2 * time, "pelvis_ty": 0.94 + 0.02 * one, "pelvis_tz": 0.05 * two}
    for side, wave in (("r", one), ("l", two)):
        columns |= {f"hip_flexion_{side}": 30.0 * wave, f"hip_adduction_{side}": 4.0 * wave}
        columns |= {f"hip_rotation_{side}": -3.0 * wave, f"knee_angle_{side}": 30.0 + 25.0 * wave}
        columns |= {f"ankle_angle_{side}": 10.0 * wave, f"subtalar_angle_{side}": 2.0 * wave}
        columns |= {f"mtp_angle_{side}": 5.0 * wave, f"arm_flex_{side}": -20.0 * wave, f"arm_add_{side}": -10.0 + wave}
        columns |= {f"arm_rot_{side}": 5.0 * wave, f"elbow_flex_{side}": 25.0 + 10.0 * wave}
        columns |= {f"pro_sup_{side}": 40.0 + wave, f"wrist_flex_{side}": 3.0 * wave, f"wrist_dev_{side}": wave}
    return columns | {"lumbar_extension": -5.0 + one, "lumbar_bending": 2.0 * one, "lumbar_rotation": -4.0 * one}


def amass_bytes(frames: int = 12) -> bytes:
    """A body of SMPL, z up, that walks along +y and bends its knees, at 60 frames a second."""
    poses = np.zeros((frames, 72))
    phase = np.linspace(0.0, 2.0 * np.pi, frames)
    poses[:, 0] = np.pi / 2  # upright
    poses[:, [12, 15]] = 0.4 + 0.4 * np.stack([np.sin(phase), np.cos(phase)], axis=1)
    poses[:, [48 + 2, 51 + 2]] = np.array([-1.2, 1.2])  # arms hang
    trans = np.stack([np.zeros(frames), np.linspace(0.0, 0.4, frames), np.full(frames, 1.15)], axis=1)
    stream = io.BytesIO()
    np.savez_compressed(
        stream, poses=poses, trans=trans, betas=np.zeros(16), gender=np.array("neutral"), mocap_framerate=np.array(60.0)
    )
    return stream.getvalue()


# By suffix: the bytes of a good clip, after its companions are written to the given folder.
SAMPLES: dict[str, Callable[[Path], bytes]] = {
    ".bvh": _text(lambda: BVH),
    ".amc": _amc,
    ".skeleton": _text(lambda: ntu_text([("72057594037944738", 0, kinect_2_from_1(swinging_body(12)))])),
    ".txt": _text(lambda: deepmimic_text(deepmimic_frames(12))),
    ".trc": _text(lambda: trc_text(*plug_in_gait_markers(swinging_body(12)))),
    ".c3d": lambda folder: c3d_bytes(*plug_in_gait_markers(swinging_body(12))),
    ".mot": _text(lambda: mot_text(walking_angles())),
    ".motive.csv": _text(lambda: motive_text(motive_skeleton())),
    ".npz": lambda folder: npz_bytes(swinging_body(12), KINECT_1, KINECT_1_PARENTS, 30.0),
    ".glb": lambda folder: _scene(folder),
    ".amass.npz": lambda folder: amass_bytes(),
    ".fbx": _text(fbx_text),
    ".gltf": lambda folder: _gltf(folder),
}
BINARY = frozenset({".npz", ".glb", ".c3d"})
# Of readers whose suffixes others have, too.
SHARED = {"AMASS": ".amass.npz", "Motive CSV": ".motive.csv"}

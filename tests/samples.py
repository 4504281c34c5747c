"""Writers of small clips in every format that the readers read; each as the format's own tools print it."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.formats import read_clips
from motionlake.formats.write.glb import glb_bytes
from motionlake.formats.write.registry import ClipToWrite
from motionlake.motion.humanml3d import features, placed
from motionlake.motion.rotations import turn_about_y
from motionlake.motion.smpl import OFFSETS, PARENTS

from tests.marker_samples import c3d_bytes, mot_text, motive_skeleton, motive_text, walking_angles

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


def usda_text(frames: int = 12) -> str:
    """A chain of three bones as text of USD, centimetres, z up, whose first bone moves and second turns about y.

    The animation lists the joints in another order, and leaves the last one out.
    """
    half = [np.radians(1.5 * frame) for frame in range(frames)]
    turns = "".join(
        f"{frame}: [({np.cos(a):.7f}, 0, {np.sin(a):.7f}, 0), (1, 0, 0, 0)],\n" for frame, a in enumerate(half)
    )
    places = "".join(f"{frame}: [(0, 0, 30), ({2 * frame}, 0, 90)],\n" for frame in range(frames))
    rest = ", ".join(f"( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, {z}, 1) )" for z in (90, 30, 30))
    bind = ", ".join(f"( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, {z}, 1) )" for z in (90, 120, 150))
    return f"""#usda 1.0
(
    defaultPrim = "Body"
    startTimeCode = 0
    endTimeCode = {frames - 1}
    timeCodesPerSecond = 30
    metersPerUnit = 0.01
    upAxis = "Z"
)

def SkelRoot "Body"
{{
    def Skeleton "Bones" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform token[] joints = ["Hips", "Hips/Spine", "Hips/Spine/Head"]
        uniform matrix4d[] bindTransforms = [{bind}]
        uniform matrix4d[] restTransforms = [{rest}]
        rel skel:animationSource = </Body/Walk>
    }}

    def SkelAnimation "Walk"
    {{
        uniform token[] joints = ["Hips/Spine", "Hips"]
        half3[] scales = [(1, 1, 1), (1, 1, 1)]
        quatf[] rotations.timeSamples = {{
{turns}        }}
        float3[] translations.timeSamples = {{
{places}        }}
    }}
}}
"""


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


def humanml3d_bytes(frames: int = 12) -> bytes:
    """Features of HumanML3D of a body that stands with hanging arms, walks along +z and turns a little."""
    down = np.array([0.0, -1.0, 0.0])
    positions = np.zeros((frames, 22, 3))
    for joint, parent in enumerate(PARENTS[:22]):
        arm = joint in (18, 19, 20, 21)
        bone = 0.26 * down if arm else OFFSETS[joint]
        positions[:, joint] = positions[:, parent] + bone if parent >= 0 else np.array([0.0, 0.95, 0.0])
    positions = turn_about_y(positions, np.linspace(0.0, 0.3, frames))
    positions[..., 2] += np.linspace(0.0, 0.4, frames)[:, None]
    stream = io.BytesIO()
    np.save(stream, features(placed(positions)[0]).astype(np.float32))
    return stream.getvalue()


def table_text(
    positions: Float64Array, joints: Sequence[str], fps: float = 30.0, form: str = "{joint}.{axis}", sign: str = ","
) -> str:
    """A table of positions [F, J, 3] as text, its columns called by a form."""
    names = [form.format(joint=joint, axis=axis) for joint in joints for axis in "xyz"]
    rows = [
        sign.join([f"{frame / fps:.6f}", *(f"{value:.6f}" for value in row)])
        for frame, row in enumerate(positions.reshape(len(positions), -1))
    ]
    return "\n".join([sign.join(["time", *names]), *rows]) + "\n"


def table_parquet(positions: Float64Array, joints: Sequence[str], fps: float = 30.0) -> bytes:
    """The same as Parquet."""
    import pyarrow as pa
    from pyarrow import parquet

    flat = positions.reshape(len(positions), -1)
    names = [f"{joint}_{axis}" for joint in joints for axis in "xyz"]
    columns = {"time": np.arange(len(flat)) / fps, **dict(zip(names, flat.T, strict=True))}
    stream = io.BytesIO()
    parquet.write_table(pa.table(columns), stream)
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
    ".npy": lambda folder: humanml3d_bytes(),
    ".fbx": _text(fbx_text),
    ".gltf": lambda folder: _gltf(folder),
    ".usda": _text(usda_text),
    ".csv": _text(lambda: table_text(swinging_body(12), KINECT_1)),
    ".parquet": lambda folder: table_parquet(swinging_body(12), KINECT_1),
}
BINARY = frozenset({".npz", ".npy", ".glb", ".c3d", ".parquet"})
# The library that a reader needs, and the extra that brings it.
LIBRARIES = {".fbx": ("ufbx", "fbx"), ".usda": ("pxr", "usd")}
# Of readers whose suffixes others have, too.
SHARED = {"AMASS": ".amass.npz", "Motive CSV": ".motive.csv"}


def lacking(suffix: str) -> str:
    """Why a sample cannot be read here: the library that is not installed; "" where nothing is missing."""
    module, extra = LIBRARIES.get(suffix, ("", ""))
    return f"needs {module}: pip install 'motionlake[{extra}]'" if module and find_spec(module) is None else ""


def readable() -> list[str]:
    """The suffixes of samples that can be read here."""
    return [suffix for suffix in SAMPLES if not lacking(suffix)]

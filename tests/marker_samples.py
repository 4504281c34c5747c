"""Writers of small C3D files, exports of OptiTrack Motive and motions of OpenSim, each as the format's own tools do."""

from __future__ import annotations

import io
from collections.abc import Sequence

import c3d
import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.canonicalise import CanonicalMotion
from motionlake.motion.kinematics import world_rotations
from motionlake.motion.rotations import rotate
from motionlake.motion.skeleton import INDEX
from scipy.spatial.transform import Rotation

# Marker of Plug-in Gait -> canonical joint that carries it, and where it is from there as that joint turns: to the
# left, up, ahead, in metres. Of the left side: those of the right are its mirror image.
_PLUG_IN_GAIT = {
    "ASI": ("hips", 0.12, 0.08, 0.09), "PSI": ("hips", 0.04, 0.08, -0.09), "KNE": ("left_knee", 0.05, 0.0, 0.0),
    "ANK": ("left_ankle", 0.04, 0.0, 0.0), "TOE": ("left_toe", 0.0, 0.0, 0.0), "SHO": ("left_shoulder", 0.0, 0.0, 0.0),
    "ELB": ("left_elbow", 0.04, 0.0, 0.0), "WRA": ("left_wrist", 0.0, 0.0, 0.03), "FHD": ("head", 0.07, 0.0, 0.08),
    "WRB": ("left_wrist", 0.0, 0.0, -0.03), "BHD": ("head", 0.07, 0.0, -0.08),
}  # fmt: skip
LEGS = tuple(side + marker for side in "LR" for marker in ("ASI", "PSI", "KNE", "ANK", "TOE"))


def gait_markers(motion: CanonicalMotion) -> dict[str, Float64Array]:
    """Plug-in Gait's markers [F, 3] on a body that goes where it will; C7 and CLAV are between the shoulders."""
    world = world_rotations(motion.rotations)

    def on(joint: str, place: Float64Array, *offset: float) -> Float64Array:
        turn = np.ascontiguousarray(world[:, INDEX[joint]])
        return np.asarray(place + rotate(turn, np.array(offset)))

    places = motion.positions.transpose(1, 0, 2).copy()
    places[INDEX["hips"]] = (places[INDEX["left_hip"]] + places[INDEX["right_hip"]]) / 2
    between = (places[INDEX["left_shoulder"]] + places[INDEX["right_shoulder"]]) / 2
    markers = {"C7": on("chest", between, 0, 0, -0.07), "CLAV": on("chest", between, 0, 0, 0.07)}
    for name, (of, left, up, ahead) in _PLUG_IN_GAIT.items():
        for side, sign in (("left", 1.0), ("right", -1.0)):
            joint = of.replace("left", side)
            markers[side[0].upper() + name] = on(joint, places[INDEX[joint]], sign * left, up, ahead)
    return markers


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
    writer = c3d.Writer(point_rate=fps, analog_rate=0.0, point_scale=scale)
    seen = np.asarray(np.isfinite(positions).all(axis=2))
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
    titles = [[kind, name, parent, *key.split()] for kind, name, parent, numbers in things for key in numbers]
    table = [values for *_, numbers in things for values in numbers.values()]
    rows = [
        ["", "Type", *(title[0] for title in titles)],
        ["", "Name", *(title[1] for title in titles)],
        ["", "ID", *(f'"{number:X}"' for number in range(len(titles)))],
        *([["", "Parent", *(title[2] for title in titles)]] if parents else []),
        ["", "", *(title[3] for title in titles)],
        ["Frame", "Time (Seconds)", *(title[4] for title in titles)],
    ]
    lines = [",".join(settings), "", *(",".join(row) for row in rows)]
    for frame in range(frames):
        values = [f"{column[frame]:.6f}" if np.isfinite(column[frame]) else "" for column in table]
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

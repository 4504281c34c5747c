"""Pieces of a take of CMU in each format that people exchange, as programs write them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.formats.write.humanml3d import humanml3d_features
from motionlake.formats.write.joints import joint_places
from motionlake.formats.write.registry import ClipToWrite, Writer, writers
from motionlake.motion.canonicalise import METRES_PER_UNIT, CanonicalMotion, canonicalise, to_source_clip
from motionlake.motion.clip import SolvedMotion, SourceClip
from motionlake.motion.humanml3d import FPS, recovered_joints
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs
from motionlake.motion.skeleton import INDEX
from motionlake.motion.smpl import BODY_JOINTS, JOINTS, smpl_clip

from tests.marker_samples import mot_text, motive_text, walking_angles

# Points of HALPE_26, which Pose2Sim writes, that stand where canonical joints do.
POINTS: Final = {"Neck": "neck", "Head": "head"} | {
    f"{side[0]}{point}": f"{side.lower()}_{joint}"
    for side in ("Left", "Right")
    for point, joint in (("Hip", "hip"), ("Knee", "knee"), ("Ankle", "ankle"), ("BigToe", "toe"),
                         ("Shoulder", "shoulder"), ("Elbow", "elbow"), ("Wrist", "wrist"))
}  # fmt: skip
# Rotations of the canonical skeleton that stand in for SMPL's; other joints do not turn.
STANDS_FOR: Final = {
    "pelvis": "hips", **{f"{side}_{joint}": f"{side}_{joint}" for side in ("left", "right")
                         for joint in ("hip", "knee", "shoulder", "elbow")},
}  # fmt: skip
_TICKS: Final = 46_186_158_000  # of FBX, a second


@dataclass(frozen=True)
class Piece:
    """Some frames of a take.

    Attributes:
        motion: on the canonical skeleton.
        rigged: the same as a clip of Euler angles, centimetres.
        solved: where its joints are and how they are turned.
        body: its main rotations on SMPL's skeleton.
    """

    motion: CanonicalMotion
    rigged: ClipToWrite
    solved: SolvedMotion
    body: ClipToWrite

    @classmethod
    def of(cls, take: SourceClip, frames: int) -> Piece:
        """The first frames of a take."""
        clip = SourceClip(take.hierarchy, take.channels[:frames], take.fps, metres_per_unit=take.metres_per_unit)
        motion = canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs()))
        rigged = to_source_clip(motion)
        rotations = np.zeros((len(motion), BODY_JOINTS, 4))
        rotations[..., 0] = 1.0
        for joint, name in STANDS_FOR.items():
            rotations[:, JOINTS.index(joint)] = motion.rotations[:, INDEX[name]]
        body = smpl_clip(motion.positions[:, 0], rotations, motion.fps)
        return cls(
            motion,
            ClipToWrite("take", rigged, METRES_PER_UNIT, "y"),
            solve(rigged),
            ClipToWrite("take", body, 1.0, "y"),
        )

    def every(self, step: int) -> ClipToWrite:
        """The body at every so many frames, at HumanML3D's rate."""
        clip = self.body.clip
        thinned = SourceClip(clip.hierarchy, clip.channels[::step], FPS, metres_per_unit=1.0, up="y")
        return ClipToWrite("take", thinned, 1.0, "y")


def _by_writer(name: str) -> Callable[[Piece, Path], None]:
    """What motionlake itself writes."""

    def write(piece: Piece, path: Path) -> None:
        writer = writers()[name]
        assert isinstance(writer, Writer)
        writer.write(piece.body if writer.rig == "smpl" else piece.rigged, path)

    return write


def _parquet(piece: Piece, path: Path) -> None:
    """Places of joints, a column each, with the time."""
    import pyarrow as pa
    from pyarrow import parquet

    places = joint_places(piece.rigged)
    columns = {"time": np.arange(len(places)) / piece.motion.fps}
    for joint, name in enumerate(piece.rigged.clip.hierarchy.joints):
        columns |= {f"{name}.{axis}": places[:, joint, at] for at, axis in enumerate("xyz")}
    parquet.write_table(pa.table(columns), path)


def _trc(piece: Piece, path: Path) -> None:
    """The joints of a motion as Pose2Sim's points."""
    motion = piece.motion
    places = motion.positions[:, [INDEX[joint] for joint in POINTS.values()]].reshape(len(motion), -1)
    names = "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames"
    counts = f"{motion.fps:g}\t{motion.fps:g}\t{len(motion)}\t{len(POINTS)}\tm\t{motion.fps:g}\t1\t{len(motion)}"
    labels = "Frame#\tTime\t" + "\t\t\t".join(POINTS)
    with path.open("w") as stream:
        stream.write(f"PathFileType\t4\t(X/Y/Z)\t{path.name}\n{names}\n{counts}\n{labels}\n\t\t\n")
        for frame, row in enumerate(places):
            values = "\t".join(f"{value:.6f}" for value in row)
            stream.write(f"{frame + 1}\t{frame / motion.fps:.6f}\t{values}\n")


def _motive(piece: Piece, path: Path) -> None:
    """The joints as bones of an export, with quaternions, metres."""
    hierarchy, solved = piece.rigged.clip.hierarchy, piece.solved
    assert solved.world is not None
    things = []
    for joint, (name, parent) in enumerate(zip(hierarchy.joints, hierarchy.parents, strict=True)):
        columns = {
            f"Rotation {axis}": solved.world[:, joint, at] for axis, at in zip("XYZW", (1, 2, 3, 0), strict=True)
        }
        columns |= {f"Position {axis}": solved.positions[:, joint, at] / 100 for at, axis in enumerate("XYZ")}
        things.append(("Bone", f"Actor:{name}", f"Actor:{hierarchy.joints[parent]}" if parent >= 0 else "", columns))
    path.write_text(motive_text(things, piece.motion.fps))


def _mot(piece: Piece, path: Path) -> None:
    """As many frames of made-up angles of a gait model."""
    path.write_text(mot_text(walking_angles(len(piece.motion), piece.motion.fps)))


def _features(piece: Piece, path: Path) -> None:
    """HumanML3D's features at its rate."""
    clip = piece.every(round(piece.motion.fps / FPS))
    np.save(path, humanml3d_features(clip, twist=False).astype(np.float32))


def _joints(piece: Piece, path: Path) -> None:
    """HumanML3D's joints at its rate."""
    clip = piece.every(round(piece.motion.fps / FPS))
    rows = humanml3d_features(clip, twist=False)
    np.save(path, recovered_joints(rows)[0][:-1].astype(np.float32))


def _usd(piece: Piece, path: Path) -> None:
    """A skeleton and its animation, binary, centimetres, y up, a key a frame."""
    from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

    hierarchy, local = piece.rigged.clip.hierarchy, piece.solved.local
    assert local is not None
    paths: list[str] = []
    for name, parent in zip(hierarchy.joints, hierarchy.parents, strict=True):
        paths.append(name if parent < 0 else f"{paths[parent]}/{name}")

    def matrices(places: Float64Array) -> Any:
        found = np.tile(np.eye(4), (len(places), 1, 1))
        found[:, 3, :3] = places
        return Vt.Matrix4dArray([Gf.Matrix4d(each.tolist()) for each in found])

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, METRES_PER_UNIT)
    stage.SetTimeCodesPerSecond(piece.motion.fps)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(len(local) - 1)
    root = UsdSkel.Root.Define(stage, "/Body")
    skeleton, animation = UsdSkel.Skeleton.Define(stage, "/Body/Skel"), UsdSkel.Animation.Define(stage, "/Body/Anim")
    places = np.zeros_like(hierarchy.offsets)
    for joint, parent in enumerate(hierarchy.parents):
        places[joint] = hierarchy.offsets[joint] + (places[parent] if parent >= 0 else 0)
    skeleton.CreateJointsAttr(paths)
    skeleton.CreateRestTransformsAttr(matrices(hierarchy.offsets))
    skeleton.CreateBindTransformsAttr(matrices(places))
    animation.CreateJointsAttr(paths)
    animation.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1, 1, 1)] * len(paths)))
    turns, moves = animation.CreateRotationsAttr(), animation.CreateTranslationsAttr()
    offsets = hierarchy.offsets.astype(np.float32)
    for frame, (quaternions, place) in enumerate(zip(local, piece.solved.positions[:, 0], strict=True)):
        offsets[0] = place
        turns.Set(Vt.QuatfArray([Gf.Quatf(*map(float, each)) for each in quaternions]), frame)
        moves.Set(Vt.Vec3fArray.FromNumpy(offsets), frame)
    UsdSkel.BindingAPI.Apply(root.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    stage.Save()


def _fbx(piece: Piece, path: Path) -> None:
    """A skeleton and one stack as text of FBX 7.4, centimetres, y up, a key a frame on each turned axis."""
    clip = piece.rigged.clip
    frames, fps = len(clip.channels), clip.fps
    ticks = [round(frame * _TICKS / fps) for frame in range(frames)]
    times, ids = ",".join(map(str, ticks)), iter(range(1000, 10**6))
    objects, links = [], ['C: "OO",50,0', 'C: "OO",51,50']
    objects.append(
        f'AnimationStack: 50, "AnimStack::take", "" {{\nProperties70: {{\nP: "LocalStart", "KTime", "Time", "",0\n'
        f'P: "LocalStop", "KTime", "Time", "",{ticks[-1]}\n}}\n}}\nAnimationLayer: 51, "AnimLayer::base", "" {{\n}}'
    )

    def animate(model: int, what: str, numbers: Float64Array) -> None:
        node = next(ids)
        held = "".join(f'P: "d|{axis}", "Number", "", "A",{numbers[0, at]:.6f}\n' for at, axis in enumerate("XYZ"))
        objects.append(f'AnimationCurveNode: {node}, "AnimCurveNode::{what[0]}", "" {{\nProperties70: {{\n{held}}}\n}}')
        links.extend([f'C: "OO",{node},51', f'C: "OP",{node},{model}, "Lcl {what}"'])
        for at, axis in enumerate("XYZ"):
            curve = next(ids)
            values = ",".join(f"{value:.6f}" for value in numbers[:, at])
            lists = f"KeyTime: *{frames} {{\na: {times}\n}}\nKeyValueFloat: *{frames} {{\na: {values}\n}}"
            flags = "KeyAttrFlags: *1 {\na: 4\n}\nKeyAttrDataFloat: *4 {\na: 0,0,0,0\n}"
            count = f"KeyAttrRefCount: *1 {{\na: {frames}\n}}"
            objects.append(
                f'AnimationCurve: {curve}, "AnimCurve::", "" {{\nKeyVer: 4008\n{lists}\n{flags}\n{count}\n}}'
            )
            links.append(f'C: "OP",{curve},{node}, "d|{axis}"')

    models: list[int] = []
    for joint, (name, parent) in enumerate(zip(clip.hierarchy.joints, clip.hierarchy.parents, strict=True)):
        model, attribute = next(ids), next(ids)
        x, y, z = clip.hierarchy.offsets[joint]
        place = f'P: "Lcl Translation", "Lcl Translation", "", "A",{x:.6f},{y:.6f},{z:.6f}'
        objects.append(f'NodeAttribute: {attribute}, "NodeAttribute::", "LimbNode" {{\nTypeFlags: "Skeleton"\n}}')
        objects.append(
            f'Model: {model}, "Model::{name}", "LimbNode" {{\nVersion: 232\nProperties70: {{\n{place}\n}}\n}}'
        )
        links += [f'C: "OO",{attribute},{model}', f'C: "OO",{model},{models[parent] if parent >= 0 else 0}']
        models.append(model)
        if joint == 0:
            animate(model, "Translation", clip.channels[:, :3])
        animate(model, "Rotation", clip.channels[:, [5 + 3 * joint, 4 + 3 * joint, 3 + 3 * joint]])
    axes = "".join(
        f'P: "{name}", "int", "Integer", "",{value}\n'
        for name, value in (("UpAxis", 1), ("UpAxisSign", 1), ("FrontAxis", 2), ("FrontAxisSign", 1),
                            ("CoordAxis", 0), ("CoordAxisSign", 1), ("TimeMode", 14))
    )  # fmt: skip
    numbers = f'P: "UnitScaleFactor", "double", "Number", "",1\nP: "CustomFrameRate", "double", "Number", "",{fps:g}\n'
    path.write_text(
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {\nFBXHeaderVersion: 1003\nFBXVersion: 7400\n}\n"
        f"GlobalSettings: {{\nVersion: 1000\nProperties70: {{\n{axes}{numbers}}}\n}}\n"
        "Objects: {\n" + "\n".join(objects) + "\n}\nConnections: {\n" + "\n".join(links) + "\n}\n"
    )


# By the end of the file's name.
WRITE: Final[dict[str, Callable[[Piece, Path], None]]] = {
    "take.amass.npz": _by_writer("amass"),
    "take.glb": _by_writer("glb"),
    "take.csv": _by_writer("csv"),
    "take.parquet": _parquet,
    "take.trc": _trc,
    "take.motive.csv": _motive,
    "take.mot": _mot,
    "joints.npy": _joints,
    "features.npy": _features,
    "take.fbx": _fbx,
    "take.usdc": _usd,
}

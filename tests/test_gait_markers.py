"""Markers of pelvis and legs alone: against the same body with all of its markers, and files that fit but in part."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.formats.markers import ARMLESS, HEADLESS, NECKLESS
from motionlake.motion.canonicalise import CanonicalMotion, canonicalise
from motionlake.motion.kinematics import solve
from motionlake.motion.marker_sets import fitting_sets, marker_sets
from motionlake.motion.quality.faults import Recording
from motionlake.motion.quality.verdict import check
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.rigs import identify, load_rigs
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS
from motionlake.stages.frames import canonical_motions
from motionlake.stages.sources import IngestOptions

from tests.marker_samples import LEGS, c3d_bytes, gait_markers
from tests.samples import plug_in_gait_markers, swinging_body, trc_text

RIGS = load_rigs()
TRUNK = ("C7", "CLAV")
ARMS_OF_BODY = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "elbow", "wrist"))
LOWER = tuple(joint for joint in JOINTS if joint.split("_")[-1] in ("hips", "hip", "knee", "ankle", "toe"))
WALKS = ("02_01", "05_01", "07_02", "08_08", "35_17", "49_01")


def swinging() -> dict[str, Float64Array]:
    names, places = plug_in_gait_markers(swinging_body(40))
    return dict(zip(names, places.transpose(1, 0, 2), strict=True))


def read(
    folder: Path, markers: Mapping[str, Float64Array], kept: Iterable[str], suffix: str = ".trc"
) -> tuple[CanonicalMotion, tuple[str, ...]]:
    """The motion of some of the markers, by way of a file, and the reader's notes."""
    names = list(kept)
    places = np.stack([markers[name] for name in names], axis=1)
    path = folder / f"walk{suffix}"
    path.write_bytes(trc_text(names, places).encode() if suffix == ".trc" else c3d_bytes(names, places))
    (clip,) = read_clips(path)
    return canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, RIGS)), clip.notes


def apart(one: CanonicalMotion, other: CanonicalMotion, joint: str) -> Float64Array:
    distance: Float64Array = np.linalg.norm(one.positions[:, INDEX[joint]] - other.positions[:, INDEX[joint]], axis=1)
    return distance


def bones(motion: CanonicalMotion, joints: Collection[str]) -> Float64Array:
    """[F, n] metres from each joint to its parent."""
    below = [INDEX[joint] for joint in joints]
    lengths: Float64Array = np.linalg.norm(
        motion.positions[:, below] - motion.positions[:, [PARENTS[joint] for joint in below]], axis=2
    )
    return lengths


@pytest.mark.parametrize("suffix", [".trc", ".c3d"])
def test_legs_alone_go_in_as_they_are_with_the_rest_of_the_body(suffix: str, tmp_path: Path) -> None:
    markers = swinging()
    whole, notes = read(tmp_path, markers, markers, suffix)
    assert {ARMLESS, NECKLESS, HEADLESS}.isdisjoint(notes)
    legs, notes = read(tmp_path, markers, LEGS, suffix)
    assert {"joints from markers: plug_in_gait", ARMLESS, NECKLESS, HEADLESS} <= set(notes)
    assert set(legs.filled) - set(whole.filled) == {"neck", "head", *ARMS_OF_BODY}
    trunk, notes = read(tmp_path, markers, [*LEGS, *TRUNK], suffix)
    assert {ARMLESS, HEADLESS} <= set(notes)
    assert NECKLESS not in notes
    assert set(trunk.filled) - set(whole.filled) == {"head", *ARMS_OF_BODY}
    for joint in LOWER:
        assert not apart(legs, whole, joint).any(), joint
        assert not apart(trunk, whole, joint).any(), joint
    assert not apart(trunk, whole, "neck").any()
    assert bones(legs, ("spine", "chest", "neck", "head", *ARMS_OF_BODY)).std(axis=0).max() < 1e-6


def test_shoulders_with_markers_are_where_these_are_and_arms_hang_from_them(tmp_path: Path) -> None:
    markers = swinging()
    whole, _ = read(tmp_path, markers, markers)
    body, notes = read(tmp_path, markers, [*LEGS, *TRUNK, "LSHO", "RSHO"])
    assert ARMLESS in notes
    for side in ("left", "right"):
        assert f"{side}_shoulder" not in body.filled
        assert not apart(body, whole, f"{side}_shoulder").any()
        arm = body.positions[:, INDEX[f"{side}_wrist"]] - body.positions[:, INDEX[f"{side}_shoulder"]]
        assert (arm[:, 1] < -0.95 * np.linalg.norm(arm, axis=1)).all()


@pytest.mark.recordings
@pytest.mark.parametrize("name", WALKS)
def test_real_walks_keep_their_legs_and_get_a_person_above(name: str, recordings: Path, tmp_path: Path) -> None:
    path = recordings / "cmu_bvh" / "clips" / f"{name}.bvh"
    (body,) = canonical_motions(path, RIGS, IngestOptions())
    markers = gait_markers(body.motion[1:])  # the first frame is a pose for calibration
    whole, _ = read(tmp_path, markers, markers)
    legs, _ = read(tmp_path, markers, LEGS)
    trunk, _ = read(tmp_path, markers, [*LEGS, *TRUNK])
    for joint in LOWER:
        assert not apart(legs, whole, joint).any(), joint
        assert not apart(trunk, whole, joint).any(), joint
    assert apart(legs, whole, "neck").max() < 0.2
    assert max(apart(trunk, whole, f"{side}_shoulder").max() for side in ("left", "right")) < 0.07
    assert apart(trunk, whole, "head").max() < 0.1
    up = [m.positions[:, INDEX["neck"]] - m.positions[:, 0] for m in (legs, whole)]
    cosine = (up[0] * up[1]).sum(axis=1) / np.prod(np.linalg.norm(up, axis=2), axis=0)
    assert cosine.min() > np.cos(np.radians(25))
    for made in (legs, trunk):
        assert made.body_height == pytest.approx(whole.body_height, rel=0.1)
        assert bones(made, ARMS_OF_BODY[1:3]).std(axis=0).max() < 1e-6
        assert (made.positions[:, INDEX["left_wrist"], 1] < made.positions[:, INDEX["left_shoulder"], 1] - 0.4).all()
    assert bones(legs, ("spine", "neck", "head")).std(axis=0).max() < 1e-6


def test_a_trunk_turns_with_the_chest_and_one_without_markers_with_the_pelvis(tmp_path: Path) -> None:
    markers = swinging()
    middle = (markers["C7"] + markers["CLAV"]) / 2
    angle = np.radians(30.0)
    ahead = np.array([np.sin(angle), 0.0, -np.cos(angle)])  # of a body that faces -z: 30 degrees to its right
    markers |= {"C7": middle - 0.05 * ahead, "CLAV": middle + 0.05 * ahead}
    for kept, turned in ((LEGS, 0.0), ([*LEGS, *TRUNK], 30.0)):
        motion, _ = read(tmp_path, markers, kept)
        across = motion.positions[:, INDEX["right_shoulder"]] - motion.positions[:, INDEX["left_shoulder"]]
        np.testing.assert_allclose(np.degrees(np.arctan2(across[:, 2], across[:, 0])), turned, atol=1.0)


def test_a_trunk_without_markers_goes_on_where_the_legs_point(tmp_path: Path) -> None:
    """Of a body that lies, too, and whose pelvis hangs forward as far as pelvises do."""
    for tilt in (0.0, 12.0):
        markers = swinging()
        for side in "LR":
            markers[f"{side}ASI"] = markers[f"{side}ASI"] - [0.0, 0.18 * np.sin(np.radians(tilt)), 0.0]
        upright, _ = read(tmp_path, markers, LEGS)
        trunk = upright.positions[:, INDEX["neck"]] - upright.positions[:, 0]
        assert (trunk[:, 1] > np.cos(np.radians(3.0)) * np.linalg.norm(trunk, axis=1)).all(), tilt
    lying = {name: places[:, [0, 2, 1]] * [1.0, 1.0, -1.0] for name, places in swinging().items()}
    motion, _ = read(tmp_path, lying, LEGS)
    trunk = motion.positions[:, INDEX["neck"]] - motion.positions[:, 0]
    assert (np.abs(trunk[:, 2]) > np.cos(np.radians(3.0)) * np.linalg.norm(trunk, axis=1)).all()


def test_up_is_told_by_the_legs_where_a_file_has_no_more(tmp_path: Path) -> None:
    markers = swinging()
    for up, order, signs in (("y", [0, 1, 2], [1, 1, 1]), ("z", [0, 2, 1], [1, -1, 1])):
        places = np.stack([markers[name][:, order] * signs for name in LEGS], axis=1)
        (tmp_path / "walk.c3d").write_bytes(c3d_bytes(LEGS, places, screen=None))
        (clip,) = read_clips(tmp_path / "walk.c3d")
        assert clip.up == up
        assert f"up is {up}, by the body" in clip.notes


@pytest.mark.parametrize("name", [one.name for one in marker_sets() if one.pelvis is not None])
def test_every_set_with_a_pelvis_may_be_legs(name: str) -> None:
    whole = next(one for one in marker_sets() if one.name == name)
    legs = {
        joint: markers
        for joint, markers in whole.joints.items()
        if joint.split("_")[1] in ("hip", "knee", "ankle", "toe")
    }
    assert whole.pelvis is not None
    pelvis = (whole.pelvis.left_front, whole.pelvis.right_front, *whole.pelvis.back)
    markers = {*pelvis, *(marker for each in legs.values() for marker in each)}
    best = fitting_sets(markers)[0]
    assert dict(best.joints) == legs  # of some sets the legs are called alike
    for marker in markers:
        if marker.endswith((".Med", "_FME", "_TAM")) and not name.endswith("_lateral"):
            assert fitting_sets(markers - {marker})[0].name == f"{name}_lateral"
        else:
            with pytest.raises(ClipError, match=f"lacks {marker}"):
                fitting_sets(markers - {marker})


def test_more_of_a_body_comes_before_less() -> None:
    names, _ = plug_in_gait_markers(swinging_body(2))
    centres = next(one for one in marker_sets() if one.name == "plug_in_gait_centres_legs").required
    assert fitting_sets([*centres, *names])[0].name == "plug_in_gait"
    assert {one.unmarked for one in fitting_sets([*centres, *names])} == {()}
    assert fitting_sets([*centres, *LEGS])[0].name == "plug_in_gait_centres_legs"
    both = fitting_sets([*LEGS, *TRUNK, *(f"{side}{marker}" for side in "LR" for marker in ("HJC", "KJC", "AJC"))])
    assert both[0].name == "joint_centres_legs"
    assert "neck_centre" in both[0].joints
    hbm = [f"{side}{marker}" for side in "LR" for marker in ("ASIS", "PSIS", "LEK", "MEK", "LM", "MM", "MT2")]
    assert {one.name for one in fitting_sets([*LEGS, *hbm, "C7", "JN"])} == {"hbm"}  # by the others, no neck


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        (("LELB", "RELB"), "lacks C7, CLAV, LSHO, LWRA, LWRB, RSHO, RWRA, RWRB"),  # arms in part
        (("C7", "CLAV", "LSHO", "RSHO", "LELB", "RELB", "LWRA", "RWRA", "RWRB"), "lacks LWRB"),  # of which one is lost
        (("LSHO", "RSHO", "LELB", "RELB", "LWRA", "LWRB", "RWRA", "RWRB"), "lacks C7, CLAV"),  # arms without a trunk
        (("LFHD", "RFHD", "LBHD"), "lacks C7, CLAV, RBHD"),  # a head in part
        (("LLEL", "LMEL"), "lacks"),  # arms by names of another set
    ],
)
def test_a_body_that_is_more_than_legs_is_not_taken_for_legs(more: tuple[str, ...], reason: str) -> None:
    with pytest.raises(ClipError, match=reason):
        fitting_sets([*LEGS, *more])


def test_centres_of_legs_are_not_all_of_a_body_with_arms() -> None:
    legs = next(one for one in marker_sets() if one.name == "joint_centres_legs")
    assert fitting_sets(legs.required)
    with pytest.raises(ClipError, match="fit no marker set"):
        fitting_sets([*legs.required, "LELB", "RELB"])


def test_a_lost_marker_of_the_arms_does_not_make_them_hang(tmp_path: Path) -> None:
    markers = swinging()
    markers["LWRB"] = np.where(np.arange(40)[:, None] < 30, np.nan, markers["LWRB"])
    with pytest.raises(ClipError, match="LWRB is seen in 10 of 40 frames"):
        read(tmp_path, markers, markers)


def test_clusters_without_knees_and_ankles_stay_out() -> None:
    walk = ["R.ASIS", "L.ASIS", "V.Sacral", *(f"{side}.{of}.{at}" for side in "RL" for of in ("Thigh", "Shank")
            for at in ("Upper", "Front", "Rear")), *(f"{side}.Toe.Tip" for side in "RL")]  # fmt: skip
    with pytest.raises(ClipError, match=r"lacks L.Knee.Lat, L.Ankle.Lat, R.Knee.Lat, R.Ankle.Lat$"):
        fitting_sets(walk)
    lateral = [f"{side}.{of}.Lat" for side in "RL" for of in ("Knee", "Ankle")]
    assert fitting_sets([*walk, *lateral])[0].name == "opensim_gait_lateral"
    assert fitting_sets([*walk, *lateral, *(name.replace("Lat", "Med") for name in lateral)])[0].name == "opensim_gait"


def test_points_by_these_names_that_are_no_legs_stay_out(tmp_path: Path) -> None:
    """Markers on an object, or mixed up: shanks three times as long as thighs."""
    markers = swinging()
    for side in "LR":
        markers[f"{side}KNE"] = markers[f"{side}KNE"] + [0.0, 0.25, 0.0]
    with pytest.raises(ClipError, match=r"no person's legs: thighs are 0\.\d+ m long, shanks 0\.\d+ m"):
        read(tmp_path, markers, LEGS)
    markers |= {name: np.zeros((40, 3)) + place for name, place in zip(LEGS, np.linspace(1, 2, 10), strict=True)}
    with pytest.raises(ClipError, match="the markers of the pelvis are in one line"):
        read(tmp_path, markers, LEGS)


def test_quality_judges_no_joint_that_was_made_up() -> None:
    rng = np.random.default_rng(2)
    frames = 120
    positions = np.tile(rng.normal(size=(21, 3)), (frames, 1, 1))
    positions[:, INDEX["left_wrist"]] += rng.normal(scale=0.05, size=(frames, 3)) + np.linspace(0, 2, frames)[:, None]
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (frames, 21, 1))

    def kinds(filled: tuple[str, ...]) -> set[tuple[str, str]]:
        recording = Recording(positions, rotations, 100.0, filled=filled)
        return {(fault.kind, fault.joint) for fault in check(recording, QualityConfig()).faults}

    told = {("jitter", "left_wrist"), ("limb_drift", "left_wrist")}
    assert told <= kinds(())
    assert not {kind for kind, _ in told} & {kind for kind, _ in kinds(("left_wrist",))}

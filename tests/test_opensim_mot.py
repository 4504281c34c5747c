"""OpenSim motions against rotations worked out with matrices, poses worked out by hand, and damaged files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import is_clip, read_clips
from motionlake.formats.opensim_mot import BONES, HANGING, UPRIGHT
from motionlake.motion.canonicalise import CanonicalMotion, canonicalise
from motionlake.motion.kinematics import solve
from motionlake.motion.rigs import identify, load_rigs
from motionlake.motion.skeleton import INDEX, JOINTS

from tests.damage import damaged_bytes
from tests.marker_samples import mot_text, walking_angles
from tests.test_damaged_files import EXTRA_MEMORY, SECONDS_PER_FILE, limited_memory, limited_time

Axis = tuple[float, float, float]
Turns = tuple[tuple[str, Axis], ...]
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
# Of the right side, as the model's file lists them: where a joint is in its parent's frame, and what turns there.
LEG: tuple[tuple[Axis, Turns], ...] = (
    ((-0.056276, -0.07849, 0.07726), (("hip_flexion", Z), ("hip_adduction", X), ("hip_rotation", Y))),
    ((-4.6e-07, -0.404425, -0.00126526), (("knee_angle", (0, -0.0707131, -0.997497)),)),
    ((-0.01, -0.4, 0), (("ankle_angle", (-0.105014, -0.174022, 0.979126)),)),
    ((-0.04877, -0.04195, 0.00792), (("subtalar_angle", (0.78718, 0.604747, -0.120949)),)),
    ((0.1788, -0.002, 0.00108), ()),
)
ARM: tuple[tuple[Axis, Turns], ...] = (
    ((-0.1007, 0.0815, 0), (("lumbar_extension", Z), ("lumbar_bending", X), ("lumbar_rotation", Y))),
    ((0.003155, 0.3715, 0.17), (("arm_flex", Z), ("arm_add", X), ("arm_rot", Y))),
    ((0.013144, -0.286273, -0.009595), (("elbow_flex", (0.226047, 0.022269, 0.973862)),)),
    ((-0.006727, -0.013007, 0.026083), (("pro_sup", (0.056398, 0.998406, 0.001952)),)),
    ((-0.008797, -0.235841, 0.01361), ()),
)
PELVIS: Turns = (("pelvis_tilt", Z), ("pelvis_list", X), ("pelvis_rotation", Y))
METRES = ("time", "pelvis_tx", "pelvis_ty", "pelvis_tz")


def written(folder: Path, text: str, name: str = "walk.mot") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def canonical(path: Path) -> CanonicalMotion:
    (clip,) = read_clips(path)
    return canonicalise(clip, solve(clip), identify(clip.hierarchy.joints, load_rigs()))


def rodrigues(axis: Axis, radians: float) -> Float64Array:
    """[4, 4] of a turn about an axis, by Rodrigues' formula."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(radians) * cross + (1 - np.cos(radians)) * cross @ cross
    return matrix


def chain(angles: dict[str, float], joints: tuple[tuple[Axis, Turns], ...], side: str) -> Float64Array:
    """[J, 3] where the joints of a limb are, by matrices; left is right seen in a mirror."""
    mirror = np.diag([1.0, 1.0, -1.0 if side == "l" else 1.0, 1.0])
    matrix = np.eye(4)
    matrix[:3, 3] = [angles[f"pelvis_t{axis}"] for axis in "xyz"]
    for name, axis in PELVIS:
        matrix = matrix @ rodrigues(axis, np.deg2rad(angles[name]))
    places = []
    for offset, turns in joints:
        step = np.eye(4)
        step[:3, 3] = offset
        middle = bool(turns) and turns[0][0].startswith("lumbar")
        for name, axis in turns:
            step = step @ rodrigues(axis, np.deg2rad(angles[name if middle else f"{name}_{side}"]))
        matrix = matrix @ (step if middle else mirror @ step @ mirror)
        places.append(matrix[:3, 3])
    return np.array(places)


def test_limbs_are_where_matrices_put_them(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    columns = walking_angles(20)
    for name in columns:
        if name not in METRES:
            columns[name] = columns[name] + rng.uniform(-20, 20, 20)
    for side in "rl":
        columns[f"knee_angle_{side}"] = np.abs(columns[f"knee_angle_{side}"])
    motion = canonical(written(tmp_path, mot_text(columns)))
    assert motion.fps == 100.0
    for frame in range(20):
        angles = {name: float(values[frame]) for name, values in columns.items()}
        for side, word in (("r", "right"), ("l", "left")):
            hip, knee, ankle, _, toe = chain(angles, LEG, side)
            _, shoulder, elbow, _, wrist = chain(angles, ARM, side)
            limbs = {"hip": hip, "knee": knee, "ankle": ankle, "toe": toe}
            limbs |= {"shoulder": shoulder, "elbow": elbow, "wrist": wrist}
            for joint, place in limbs.items():
                off = np.linalg.norm(motion.positions[frame, INDEX[f"{word}_{joint}"]] - place)
                assert off < 1e-3 * motion.body_height, (frame, joint, side)


def standing(**angles: float) -> dict[str, Float64Array]:
    """Two frames of a body that stands, some of whose angles are not 0."""
    columns = {name: np.zeros(2) for name in walking_angles(2)}
    columns |= {name: np.full(2, value) for name, value in angles.items()}
    return columns | {"time": np.array([0.0, 0.01]), "pelvis_ty": np.full(2, 0.95)}


def test_poses_are_those_of_a_body_that_faces_x(tmp_path: Path) -> None:
    """A thigh forward, a shin down from there; an arm to the side, a forearm forward."""
    pose = standing(hip_flexion_r=90.0, knee_angle_r=90.0, arm_add_l=-90.0, elbow_flex_r=90.0, lumbar_bending=0.0)
    places = canonical(written(tmp_path, mot_text(pose))).positions[0]

    def bone(upper: str, lower: str) -> Float64Array:
        vector = places[INDEX[lower]] - places[INDEX[upper]]
        return np.asarray(vector / np.linalg.norm(vector))

    assert bone("right_hip", "right_knee") @ [1, 0, 0] > 0.99
    assert bone("right_knee", "right_ankle") @ [0, -1, 0] > 0.99
    assert bone("left_shoulder", "left_elbow") @ [0, 0, -1] > 0.99
    assert bone("right_elbow", "right_wrist") @ [1, 0, 0] > 0.95
    assert bone("left_hip", "right_hip") @ [0, 0, 1] > 0.99
    assert bone("hips", "head") @ [0, 1, 0] > 0.99


def test_knees_bend_back_whatever_the_sign(tmp_path: Path) -> None:
    columns = walking_angles(20)
    one = canonical(written(tmp_path, mot_text(columns)))
    for side in "rl":
        columns[f"knee_angle_{side}"] = -columns[f"knee_angle_{side}"]
    path = written(tmp_path, mot_text(columns))
    np.testing.assert_allclose(canonical(path).positions, one.positions, atol=1e-9)
    assert any("negative where knees bend" in note for note in read_clips(path)[0].notes)


@pytest.mark.parametrize("said", ["no", None])
def test_radians_are_those_of_the_header_or_told_by_size(said: str | None, tmp_path: Path) -> None:
    columns = walking_angles(20)
    wanted = canonical(written(tmp_path, mot_text(columns))).positions
    radians = {name: values if name in METRES else np.deg2rad(values) for name, values in columns.items()}
    path = written(tmp_path, mot_text(radians, said))
    np.testing.assert_allclose(canonical(path).positions, wanted, atol=1e-6)
    assert any("taken for radians" in note for note in read_clips(path)[0].notes) == (said is None)
    path = written(tmp_path, mot_text(columns, None))
    np.testing.assert_allclose(canonical(path).positions, wanted, atol=1e-6)


def test_arms_hang_and_the_trunk_is_straight_where_the_file_has_neither(tmp_path: Path) -> None:
    columns = {name: values for name, values in walking_angles(20).items()
               if not name.startswith(("arm", "elbow", "pro_sup", "wrist", "lumbar"))}  # fmt: skip
    path = written(tmp_path, mot_text(columns))
    assert set(read_clips(path)[0].notes) >= {BONES, HANGING, UPRIGHT}
    motion = canonical(path)
    places = motion.positions
    measured = {"hips", *(f"{side}_{leg}" for side in ("left", "right") for leg in ("hip", "knee", "ankle", "toe"))}
    assert set(motion.filled) == set(JOINTS) - measured
    for side in ("left", "right"):
        arm = places[:, INDEX[f"{side}_wrist"]] - places[:, INDEX[f"{side}_shoulder"]]
        assert (arm[:, 1] < -0.45).all()
    assert {HANGING, UPRIGHT}.isdisjoint(read_clips(written(tmp_path, mot_text(walking_angles())))[0].notes)


def test_states_of_opensim_4_have_paths(tmp_path: Path) -> None:
    columns = walking_angles(20)
    wanted = canonical(written(tmp_path, mot_text(columns))).positions
    named = {"time": columns["time"]}
    for name, values in columns.items():
        if name != "time":
            named[f"/jointset/some_joint/{name}/value"] = values if name in METRES else np.deg2rad(values)
            named[f"/jointset/some_joint/{name}/speed"] = values * 0 + 9.0
    path = written(tmp_path, mot_text(named, "no"), "states.sto")
    np.testing.assert_allclose(canonical(path).positions, wanted, atol=1e-6)


def test_headers_of_older_programs_are_read(tmp_path: Path) -> None:
    text = mot_text(walking_angles(20))
    wanted = read_clips(written(tmp_path, text))[0]
    head, end, rows = text.partition("endheader\n")
    tabs = "\t" * 37
    tabbed = "".join(f"{line}{tabs}\n" for line in f"{head}endheader".splitlines() if line)
    simm = f"name walk\ndatacolumns 38\ndatarows 20\nrange 0 0.19\n{end}"
    for header in (tabbed, simm, head.replace("\n", "\r\n") + "endheader \r\n"):
        (clip,) = read_clips(written(tmp_path, header + rows))
        np.testing.assert_array_equal(clip.channels, wanted.channels)
    with pytest.raises(ClipError, match="38 columns declared"):
        read_clips(written(tmp_path, tabbed + rows.replace("pelvis_list\t", "", 1)))


def test_commas_of_a_spreadsheet_are_tabs(tmp_path: Path) -> None:
    text = mot_text(walking_angles(20))
    wanted = read_clips(written(tmp_path, text))[0]
    head, _, rows = text.partition("endheader\n")
    padded = "".join(f"{line}{',' * 37}\n" for line in f"{head}endheader".splitlines())
    (clip,) = read_clips(written(tmp_path, padded + rows.replace("\t", ",")))
    np.testing.assert_array_equal(clip.channels, wanted.channels)
    assert clip.fps == wanted.fps


def test_angles_of_vertebrae_add_up(tmp_path: Path) -> None:
    columns = walking_angles(20)
    bent = columns | {"lumbar_extension": np.full(20, -20.0)}
    bent |= {"lumbar_bending": np.zeros(20), "lumbar_rotation": np.zeros(20)}
    parts = {name: values for name, values in columns.items() if not name.startswith("lumbar")}
    parts |= {f"{pair}_Flex_Ext": np.full(20, -4.0) for pair in ("L5_S1", "L4_L5", "L3_L4", "L2_L3", "L1_L2")}
    parts["L5_S1_Lat_Bending"] = np.zeros(20)
    wanted = canonical(written(tmp_path, mot_text(bent))).positions
    np.testing.assert_allclose(canonical(written(tmp_path, mot_text(parts))).positions, wanted, atol=1e-9)


def test_uneven_times_are_resampled(tmp_path: Path) -> None:
    columns = walking_angles(101)
    kept = np.delete(np.arange(101), [3, 4, 50, 77])
    (clip,) = read_clips(written(tmp_path, mot_text({name: values[kept] for name, values in columns.items()})))
    (whole,) = read_clips(written(tmp_path, mot_text(columns)))
    assert clip.fps == 100.0
    assert "frames of unequal duration, resampled to 100 a second" in clip.notes
    assert len(clip.channels) == 101
    np.testing.assert_allclose(solve(clip).positions, solve(whole).positions, atol=2e-3)


@pytest.mark.parametrize(
    ("header", "reason"),
    [
        (["ground_force_vx", "ground_force_vy", "ground_force_px"], "no joint angles of a gait model but forces"),
        (["/forceset/soleus_r/activation", "x", "y"], "but forces or other results"),
        (["r_shoulder_elev", "r_elbow_flex", "z"], "but something else"),
        (["pelvis_tilt", "hip_flexion_r", "hip_flexion_l"], "is no whole body: it has no column knee_angle_r"),
    ],
)
def test_other_tables_are_rejected_with_what_they_hold(header: list[str], reason: str, tmp_path: Path) -> None:
    columns = {"time": np.arange(20) / 100} | {name: np.ones(20) for name in header}
    path = written(tmp_path, mot_text(columns))
    assert is_clip(path)
    with pytest.raises(ClipError, match=reason):
        read_clips(path)


def test_what_is_wrong_is_said(tmp_path: Path) -> None:
    text = mot_text(walking_angles())
    for old, new, reason in (
        ("nRows=12", "nRows=13", "13 rows declared, 12 found"),
        ("nColumns=38", "nColumns=39", "39 columns declared, 38 named"),
        ("endheader", "endhead", "no line endheader"),
        ("time\t", "times\t", "no column time"),
        ("pelvis_list", "pelvis_tilt", "two columns of one name"),
        ("      0.05000000", "      0.00000000", "times do not rise"),
    ):
        assert old in text
        with pytest.raises(ClipError, match=reason):
            read_clips(written(tmp_path, text.replace(old, new, 1)))
    other = written(tmp_path, "some other program's .mot\n")
    assert not is_clip(other)


def test_damaged_files_are_read_or_rejected(tmp_path: Path) -> None:
    path, reasons = tmp_path / "walk.mot", []
    for data in damaged_bytes(mot_text(walking_angles()).encode(), 200, seed=13):
        path.write_bytes(data)
        try:
            with limited_memory(EXTRA_MEMORY), limited_time(SECONDS_PER_FILE):
                for clip in read_clips(path):
                    assert np.isfinite(solve(clip).positions).all()
        except ClipError as error:
            reasons.append(str(error))
    assert 40 < len(reasons) < 200
    assert not any("\n" in reason or "Error:" in reason for reason in reasons), reasons

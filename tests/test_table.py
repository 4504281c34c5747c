"""Tables in: what motionlake wrote comes back, what pandas writes is read, and other tables are left alone."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats import companions, is_clip, read_clips
from motionlake.formats.parse.table_columns import columns_of
from motionlake.formats.parse.table_map import table_map
from motionlake.formats.write.positions_csv import WRITER
from motionlake.formats.write.registry import ClipToWrite
from motionlake.motion.clip import SourceClip
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import rotate

from tests.damage import DAMAGES
from tests.lakes import motionlake, query, quick_lake
from tests.samples import KINECT_1, KINECT_1_PARENTS, SAMPLES, swinging_body, table_parquet, table_text
from tests.test_damaged_files import limited_memory, limited_time

BODY = swinging_body(12)


def written(folder: Path, text: str | bytes, name: str = "walk.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def read(folder: Path, text: str | bytes, name: str = "walk.csv") -> SourceClip:
    path = written(folder, text, name)
    assert is_clip(path)
    [clip] = read_clips(path)
    return clip


def assert_is_body(clip: SourceClip, atol: float = 1e-6) -> None:
    order = [clip.hierarchy.joints.index(name) for name in KINECT_1]
    np.testing.assert_allclose(solve(clip).positions[:, order], BODY, atol=atol)


@pytest.mark.parametrize("suffix", [".bvh", ".amc", ".npz", ".glb", ".skeleton"])
def test_what_motionlake_wrote_comes_back(suffix: str, tmp_path: Path) -> None:
    clip = read_clips(written(tmp_path, SAMPLES[suffix](tmp_path), f"sample{suffix}"))[0]
    path = tmp_path / "out.csv"
    WRITER.write(ClipToWrite("walk", clip, 0.01, "z"), path)
    assert companions(path) == [tmp_path / "out.joints.json"]
    assert not is_clip(tmp_path / "out.joints.json")
    assert is_clip(path)
    [back] = read_clips(path)
    assert back.hierarchy.joints == clip.hierarchy.joints
    assert back.hierarchy.parents == clip.hierarchy.parents
    assert (back.fps, back.metres_per_unit, back.up, back.repaired) == (clip.fps, 1.0, "y", 0)
    turned = rotate(np.array([np.sqrt(0.5), -np.sqrt(0.5), 0, 0]), solve(clip).positions) * 0.01
    np.testing.assert_allclose(solve(back).positions, turned, atol=1e-6)
    again = tmp_path / "again.csv"
    WRITER.write(ClipToWrite("walk", back, 1.0, "y"), again)
    assert again.read_bytes() == path.read_bytes()
    assert again.with_suffix(".joints.json").read_bytes() == path.with_suffix(".joints.json").read_bytes()


@pytest.mark.recordings
def test_a_real_clip_goes_out_as_a_table_and_into_a_lake(recordings: Path, tmp_path: Path, scheduler: str) -> None:
    clip = read_clips(recordings / "cmu_bvh" / "clips" / "02_01.bvh")[0]
    (tmp_path / "in").mkdir()
    WRITER.write(ClipToWrite("walk", clip, 0.0564444), tmp_path / "in" / "walk.csv")
    lake = quick_lake(tmp_path / "lake")
    run = motionlake("ingest", tmp_path / "in", "--lake", lake, "--scheduler", scheduler, "--json")
    assert run.status == 0, run.err
    [(name, rig, frames)] = query(lake, "SELECT format, rig, frames FROM clips")
    assert (name, rig, frames) == ("table", "cmu_bvh", len(clip.channels))


FORMS = ["{joint}.{axis}", "{joint}_{axis}", "{joint} {axis}", "{joint}:{axis}", "{joint}_pos_{axis}"]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("sign", [",", ";", "\t"])
@pytest.mark.parametrize("capital", [False, True])
def test_the_usual_names_of_columns_are_known(form: str, sign: str, capital: bool, tmp_path: Path) -> None:
    text = table_text(BODY, KINECT_1, form=form, sign=sign)
    if capital:
        head, _, rest = text.partition("\n")
        text = (
            sign.join(name[:-1] + name[-1].upper() for name in head.split(sign)).replace("timE", "Time") + "\n" + rest
        )
    clip = read(tmp_path, text)
    assert (clip.fps, clip.metres_per_unit, clip.up, clip.notes) == (30.0, None, None, ())
    assert clip.hierarchy.joints == KINECT_1
    assert_is_body(clip)


def test_an_axis_may_follow_a_name_as_a_capital(tmp_path: Path) -> None:
    text = table_text(BODY, KINECT_1, form="{joint}{axis}")
    head, _, rest = text.partition("\n")
    head = ",".join(name if name == "time" else name[:-1] + name[-1].upper() for name in head.split(","))
    assert_is_body(read(tmp_path, f"{head}\n{rest}"))
    assert not is_clip(written(tmp_path, text))  # "Headx" may be any word


def frame() -> pd.DataFrame:
    columns = pd.MultiIndex.from_product([KINECT_1, ["x", "y", "z"]])
    return pd.DataFrame(BODY.reshape(len(BODY), -1), columns=columns)


def test_what_pandas_writes_of_columns_of_two_levels_is_read(tmp_path: Path) -> None:
    table = frame()
    table.insert(0, ("time", ""), np.arange(12) / 60.0)
    clip = read(tmp_path, table.to_csv(index=False))
    assert clip.fps == 60.0
    assert_is_body(clip)
    stream = io.BytesIO()
    table.to_parquet(stream)
    assert_is_body(read(tmp_path, stream.getvalue(), "walk.parquet"))


def test_a_joint_may_be_named_once_over_its_columns_and_numbers_have_commas(tmp_path: Path) -> None:
    lines = table_text(BODY, KINECT_1, sign=";").replace(".", ",").split("\n")
    names = ";;;".join(KINECT_1)
    lines[0] = f"Time (ms);{names};;\n;" + ";".join("XYZ" * len(KINECT_1))
    rows = [f"{40 * frame};{line.partition(';')[2]}" for frame, line in enumerate(lines[1:-1])]
    clip = read(tmp_path, "\n".join([lines[0], *rows]))
    assert clip.fps == 25.0
    assert_is_body(clip)


def test_parquet_holds_the_same_and_so_do_structures(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    assert_is_body(read(tmp_path, table_parquet(BODY, KINECT_1), "walk.parquet"))
    kind = pa.struct([(axis, pa.float32()) for axis in "xyz"])
    joints = {
        name: pa.array([dict(zip("xyz", place, strict=True)) for place in BODY[:, joint].tolist()], kind)
        for joint, name in enumerate(KINECT_1)
    }
    parquet.write_table(pa.table({"t": np.arange(12) / 30.0, **joints}), tmp_path / "deep.parquet")
    assert_is_body(read_clips(tmp_path / "deep.parquet")[0])


MAP = """position = "p{axis}({joint})"
time = "clock"
unit = "mm"
up = "z"

[parents]
"""


def other_names(folder: Path) -> Path:
    """A table of another program and what it takes to read it: millimetres, z up, 25 frames a second."""
    text = table_text(BODY[..., [0, 2, 1]] * [1000, -1000, 1000], KINECT_1, 25.0, "p{axis}({joint})")
    return written(folder, text.replace("time", "clock", 1))


def map_text(left_out: str = "") -> str:
    pairs = zip(KINECT_1, KINECT_1_PARENTS, strict=True)
    lines = [f'{name} = "{KINECT_1[parent] if parent >= 0 else ""}"' for name, parent in pairs if name != left_out]
    return MAP + "\n".join(lines) + "\n"


def test_a_map_says_what_the_columns_are(tmp_path: Path) -> None:
    (tmp_path / "a" / "b").mkdir(parents=True)
    path = other_names(tmp_path / "a" / "b")
    assert not is_clip(path)
    with pytest.raises(ClipError, match=r"no columns of joints: write a columns\.toml beside it \(docs/tables\.md\)"):
        read_clips(path)
    for folder in (tmp_path / "a" / "b", tmp_path):
        (folder / "columns.toml").write_text(map_text())
        assert companions(path) == [folder / "columns.toml"]
        assert is_clip(path)
        [clip] = read_clips(path)
        assert (clip.fps, clip.metres_per_unit, clip.up) == (25.0, 0.001, "z")
        assert clip.hierarchy.parents == KINECT_1_PARENTS
        np.testing.assert_allclose(solve(clip).positions[..., [0, 2, 1]] * [1e-3, 1e-3, -1e-3], BODY, atol=1e-6)
        (folder / "columns.toml").unlink()
    (tmp_path / "columns.toml").write_text(map_text("HandLeft"))
    [clip] = read_clips(path)
    assert "1 joints that the map does not name are left out" in clip.notes
    assert "HandLeft" not in clip.hierarchy.joints


def test_the_map_of_the_page_is_one(tmp_path: Path) -> None:
    page = (Path(__file__).parents[1] / "docs" / "tables.md").read_text(encoding="utf-8")
    text = page.partition("```toml\n")[2].partition("```")[0]
    (tmp_path / "columns.toml").write_text(text, encoding="utf-8")
    said = table_map(tmp_path / "columns.toml")
    assert said.position is not None
    assert said.position.fullmatch("pX(Head)")
    assert (said.time, said.fps, said.metres_per_unit, said.up) == ("clock", None, 0.001, "z")
    assert said.parents == {"Pelvis": "", "Spine": "Pelvis", "Head": "Spine"}


def test_a_change_of_the_map_is_seen(tmp_path: Path, scheduler: str) -> None:
    (tmp_path / "in").mkdir()
    other_names(tmp_path / "in")
    (tmp_path / "in" / "labels.csv").write_text("file,label\nwalk.csv,walk\n")
    (tmp_path / "in" / "other.npz").write_bytes(SAMPLES[".npz"](tmp_path))
    lake = quick_lake(tmp_path / "lake")

    def ingest() -> tuple[int, int]:
        run = motionlake("ingest", tmp_path / "in", "--lake", lake, "--scheduler", scheduler, "--json")
        return run.json["clips"], run.json["rejected"]

    assert ingest() == (1, 0)
    (tmp_path / "in" / "columns.toml").write_text(map_text())
    assert ingest() == (1, 0)
    (tmp_path / "in" / "columns.toml").write_text(map_text().replace('time = "clock"', "fps = 50"))
    assert ingest() == (1, 0)
    assert query(lake, "SELECT fps, label FROM clips WHERE format = 'table'") == [(50.0, "walk")]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("fps = 0", "columns.toml: fps is 0, not a number of frames a second"),
        ("position = 'x'", "columns.toml: position is 'x', which has not one {joint} and one {axis}"),
        ("position = '{joint}-{axis}'", "has no columns fit position in columns.toml"),
        ("unit = 'ell'", "columns.toml: unit is 'ell', not one of m, dm"),
        ("up = 3", "columns.toml: up is 3, not one of x, y"),
        ("colour = 1", "columns.toml: has a key 'colour', which is none of position, time"),
        ("[parents]\nHips = 1", "[parents] is no table of names"),
        ("[parents]\nTail = ''", "columns.toml names the joint 'Tail', which has no columns of x, y and z"),
        ("[parents]\nHead = 'Tail'", "the parent of 'Head' is 'Tail', which it does not name as a joint"),
        ("[parents]\nHead = 'Spine'\nSpine = 'Head'", "has 0 root joints"),
        ("= =", "columns.toml: is no TOML"),
    ],
)
def test_what_is_wrong_with_a_map_is_said(text: str, reason: str, tmp_path: Path) -> None:
    path = written(tmp_path, table_text(BODY, KINECT_1))
    (tmp_path / "columns.toml").write_text(text)
    assert is_clip(path)
    with pytest.raises(ClipError) as caught:
        read_clips(path)
    assert reason in str(caught.value)


def without_time(text: str) -> str:
    return "\n".join(line.partition(",")[2] for line in text.split("\n"))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (without_time(table_text(BODY, KINECT_1)), "has no column of time: say --fps, or write a columns.toml"),
        (table_text(BODY, [f"part{n}" for n in range(20)]), "of no known rig, and a table names no parents: write a"),
        (table_text(BODY, KINECT_1).replace("\n0.033333", "\n0.0"), "its times do not grow: frame 2 is at 0 s"),
        (table_text(BODY, KINECT_1)[:-30], "line 13: the row has 58 fields, not 61"),
        (table_text(BODY, KINECT_1).replace("\n0.100000,", "\n0.100000,left"), "line 5: 'left0.000000' is no number"),
    ],
)
def test_what_is_wrong_with_a_table_is_said(text: str, reason: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    assert is_clip(path)
    with pytest.raises(ClipError) as caught:
        read_clips(path)
    assert reason in str(caught.value)


def test_a_rate_may_be_said_where_there_is_no_time(tmp_path: Path) -> None:
    path = written(tmp_path, without_time(table_text(BODY, KINECT_1)))
    [clip] = read_clips(path, fps=50.0)
    assert clip.fps == 50.0
    assert_is_body(clip)


def test_uneven_frames_are_resampled_with_a_note(tmp_path: Path) -> None:
    times = np.arange(30) / 30.0
    times[10:] += 0.5 / 30.0
    motion = np.linspace(1.0, 2.0, 20)[None, :, None] + times[:, None, None] * [[[1.0, 2.0, 3.0]]]
    lines = table_text(motion, KINECT_1).split("\n")
    rows = [f"{time:.6f},{line.partition(',')[2]}" for time, line in zip(times, lines[1:], strict=False)]
    clip = read(tmp_path, "\n".join([lines[0], *rows]))
    assert clip.fps == 30.0
    assert "frames last 0.03333 to 0.05 s: resampled to 30 frames a second" in clip.notes
    speeds = np.diff(solve(clip).positions, axis=0) * 30.0
    np.testing.assert_allclose(speeds, np.broadcast_to([1.0, 2.0, 3.0], speeds.shape), atol=1e-3)


def test_gaps_are_filled_and_counted(tmp_path: Path) -> None:
    holed = BODY.copy()
    holed[4:6, 7] = np.nan
    clip = read(tmp_path, table_text(holed, KINECT_1).replace("nan", ""))
    assert clip.repaired == 2
    np.testing.assert_allclose(solve(clip).positions[:4], BODY[:4], atol=1e-6)


def test_tables_of_anything_else_are_left_alone(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    numbers = np.random.default_rng(1).normal(size=(50, 120))
    sensors = ("acc", "gyro", "mag")
    others = {
        "labels.csv": "file,label,subject\na.bvh,walk,1\n",
        "segments.csv": "file,start,stop,label\na.bvh,0,10,walk\n",
        "features.csv": pd.DataFrame(numbers).to_csv(),
        "imu.csv": table_text(numbers[:, :9].reshape(-1, 3, 3), sensors),
        "empty.csv": "",
        "one.csv": "x",
        "text.csv": "all of this is prose,\nand no table; at all\n" * 500,
        "binary.csv": bytes(range(256)) * 40,
        "wide.csv": ",".join(f"galaxy{n}" for n in range(5000)) + "\n",
    }
    for name, content in others.items():
        assert not is_clip(written(tmp_path, content, name)), name
    parquet.write_table(pa.table({"state": [[1.0, 2.0]] * 5, "x": [1.0] * 5}), tmp_path / "data.parquet")
    assert not is_clip(tmp_path / "data.parquet")
    (tmp_path / "folder.csv").mkdir()
    assert not is_clip(tmp_path / "folder.csv")


def test_the_parts_of_a_lake_are_no_clips(lake: Path) -> None:
    parts = list(lake.rglob("*.parquet"))
    assert len(parts) > 1
    assert [part for part in parts if is_clip(part)] == []


def test_a_damaged_parquet_is_rejected_not_passed_over(tmp_path: Path) -> None:
    path = written(tmp_path, table_parquet(BODY, KINECT_1)[:-20], "walk.parquet")
    assert is_clip(path)
    with pytest.raises(ClipError, match="is damaged: its columns cannot be read as Parquet"):
        read_clips(path)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_200_damaged_tables_are_read_or_rejected_with_a_reason(suffix: str, tmp_path: Path) -> None:
    good = SAMPLES[suffix](tmp_path)
    rng = np.random.default_rng(22)
    rejected = []
    for number in range(200):
        path = written(tmp_path, DAMAGES[number % len(DAMAGES)](good, rng), f"{number}{suffix}")
        try:
            with limited_memory(2**30), limited_time(20):
                is_clip(path)
                for clip in read_clips(path):
                    assert np.isfinite(solve(clip).positions).all()
        except ClipError as error:
            rejected.append(str(error))
    assert all(3 < len(reason) < 300 and reason.isprintable() and "Error" not in reason for reason in rejected)
    assert 60 < len(rejected) < 200


def test_a_damaged_file_beside_a_table_is_a_reason(tmp_path: Path) -> None:
    clip = read_clips(written(tmp_path, SAMPLES[".npz"](tmp_path), "a.npz"))[0]
    path = tmp_path / "walk.csv"
    WRITER.write(ClipToWrite("walk", clip, 1.0), path)
    beside = path.with_suffix(".joints.json")
    tree = json.loads(beside.read_text())
    for change in ({"joints": 3}, {"parents": [0] * 20}, {"parents": [99] * 20}, {"fps": "x"}, {"joints": ["a"] * 20}):
        beside.write_text(json.dumps(tree | change))
        assert is_clip(path)
        with pytest.raises(ClipError):
            read_clips(path)
    beside.write_bytes(b"\xff{")
    with pytest.raises(ClipError, match=r"walk\.joints\.json: is not JSON"):
        read_clips(path)


@settings(max_examples=60)
@given(
    joints=st.lists(st.from_regex(r"[A-Z][a-z]{2,8}[0-9]?", fullmatch=True), min_size=1, max_size=12, unique=True),
    form=st.sampled_from(FORMS),
    order=st.permutations(range(36)),
)
def test_columns_of_joints_are_found_in_any_order(joints: list[str], form: str, order: list[int]) -> None:
    names = [form.format(joint=joint, axis=axis) for joint in joints for axis in "xyz"]
    shuffled = [names[number] for number in order if number < len(names)]
    extra = ["frame", *shuffled, "Lonely_x", "confidence"]
    found = columns_of(extra).joints
    assert found.keys() == set(joints)
    for joint, numbers in found.items():
        assert [extra[number] for number in numbers] == [form.format(joint=joint, axis=axis) for axis in "xyz"]


def test_numbers_are_those_that_pandas_reads(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    motion: Float64Array = BODY + rng.normal(scale=1e-3, size=BODY.shape)
    text = "\n".join(
        ",".join(f"{value:.17g}" for value in row) if number else line
        for number, (line, row) in enumerate(
            zip(
                table_text(motion, KINECT_1).split("\n"),
                [[], *np.column_stack([np.arange(12) / 30, motion.reshape(12, -1)])],
                strict=False,
            )
        )
    )
    clip = read(tmp_path, text)
    theirs = pd.read_csv(io.StringIO(text)).to_numpy()[:, 1:].reshape(12, 20, 3)
    np.testing.assert_array_equal(solve(clip).positions, theirs)

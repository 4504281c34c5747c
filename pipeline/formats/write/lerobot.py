"""Writing clips as one LeRobot data set, version 3.0 (https://huggingface.co/docs/lerobot/lerobot-dataset-v3).

A clip is an episode, its label the task. `observation.state` is the place of the root in metres, y up, and the rotation
of every joint as a vector (axis times radians); `action` is the state of the next frame, in the last one its own.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Float64Array
from motionlake.errors import ClipError
from motionlake.formats.write.registry import ClipToWrite
from motionlake.formats.write.whole import whole_file
from motionlake.motion.canonicalise import turn_to_y_up
from motionlake.motion.kinematics import solve
from motionlake.motion.rotations import multiply, rotate
from numpy.typing import NDArray

VERSION: Final = "v3.0"
DATA: Final = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES: Final = "meta/episodes/chunk-000/file-000.parquet"
STATE, ACTION = "observation.state", "action"
_CHUNK: Final = 1000  # files of a folder
_MEGABYTES: Final = 100  # of a data file
_QUANTILES: Final = (0.01, 0.1, 0.5, 0.9, 0.99)
_INTEGERS: Final = ("frame_index", "episode_index", "index", "task_index")
NO_LABEL: Final = "motion"


@dataclass
class _Set:
    """What the set holds so far."""

    fps: float = 0.0
    joints: tuple[str, ...] = ()
    frames: int = 0
    file: int = 0
    bytes: int = 0
    tasks: dict[str, int] = field(default_factory=dict)
    episodes: list[dict[str, Any]] = field(default_factory=list)
    states: list[Float32Array] = field(default_factory=list)


class LerobotWriter:
    """A LeRobot v3.0 data set without pictures."""

    name = "lerobot"
    rig = ""

    def write_all(self, motions: Iterable[ClipToWrite], folder: Path) -> list[tuple[int, ClipError]]:
        """Write the set into a folder.

        Clips that have other joints than the first, or another frame rate, are left out. What the statistics are made
        of stays in memory: 4 bytes a number of a state.

        Raises:
            ClipError: no clip could be written.
        """
        import pyarrow.parquet as pq

        made, left_out = _Set(), []
        writer = None
        try:
            for number, motion in enumerate(motions):
                try:
                    state = _state(motion)
                    _check(made, motion)
                except ClipError as error:
                    left_out.append((number, error))
                    continue
                if writer is not None and made.bytes > _MEGABYTES << 20:
                    writer.close()
                    writer, made.file, made.bytes = None, made.file + 1, 0
                rows = _rows(made, motion, state)
                if writer is None:
                    path = folder / _data_file(made.file)
                    path.parent.mkdir(parents=True, exist_ok=True)
                    writer = pq.ParquetWriter(path, rows.schema)
                writer.write_table(rows)
                _enter(made, motion, state, rows.nbytes)
        finally:
            if writer is not None:
                writer.close()
        if not made.episodes:
            raise ClipError(f"no clip could be written: {left_out[0][1]}" if left_out else "there is no clip to write")
        _write_meta(made, folder)
        return left_out


def _data_file(number: int) -> str:
    return DATA.format(chunk_index=number // _CHUNK, file_index=number % _CHUNK)


def _state(motion: ClipToWrite) -> Float32Array:
    """[F, 3 + 3 J] root and rotation vectors."""
    from scipy.spatial.transform import Rotation

    solved, turn = solve(motion.clip), turn_to_y_up(motion.up)
    if solved.local is None:
        raise ClipError("holds positions only: say --rig canonical, or another that turns")
    local = solved.local.copy()
    local[:, 0] = multiply(turn, np.ascontiguousarray(local[:, 0]))
    vectors: Float64Array = Rotation.from_quat(local.reshape(-1, 4), scalar_first=True).as_rotvec()
    root = rotate(turn, solved.positions[:, 0]) * motion.metres_per_unit
    return np.hstack([root, vectors.reshape(len(root), -1)]).astype(np.float32)


def _check(made: _Set, motion: ClipToWrite) -> None:
    """Take the rate and joints of the first clip; `ClipError` where those of a later one are others."""
    fps, joints = motion.clip.fps, motion.clip.hierarchy.joints
    if abs(fps - round(fps)) > 1e-3:
        raise ClipError(f"has {fps:g} frames a second, and LeRobot takes whole numbers: say --fps")
    if made.fps and round(fps) != made.fps:
        raise ClipError(f"has {fps:g} frames a second, and the set {made.fps:g}: say --fps")
    if made.joints and joints != made.joints:
        raise ClipError("has other joints than the set: say --rig")
    made.fps, made.joints = round(fps), joints


def _task(motion: ClipToWrite) -> str:
    return str(motion.facts.get("label") or NO_LABEL)


def _rows(made: _Set, motion: ClipToWrite, state: Float32Array) -> Any:
    """The rows of a clip as they stand in a data file."""
    import pyarrow as pa

    frames, width = state.shape
    task = made.tasks.setdefault(_task(motion), len(made.tasks))

    def vectors(values: Float32Array) -> Any:
        return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), width)

    number, numbers = len(made.episodes), np.arange(frames)
    return pa.table(
        {
            STATE: vectors(state),
            ACTION: vectors(np.concatenate([state[1:], state[-1:]])),
            "timestamp": (numbers / made.fps).astype(np.float32),
            "frame_index": numbers,
            "episode_index": np.full(frames, number),
            "index": made.frames + numbers,
            "task_index": np.full(frames, task),
        }
    )


def _enter(made: _Set, motion: ClipToWrite, state: Float32Array, size: int) -> None:
    """Note an episode that has been written."""
    number, frames = len(made.episodes), len(state)
    row: dict[str, Any] = {
        "episode_index": number,
        "tasks": [_task(motion)],
        "length": frames,
        "data/chunk_index": made.file // _CHUNK,
        "data/file_index": made.file % _CHUNK,
        "dataset_from_index": made.frames,
        "dataset_to_index": made.frames + frames,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
        "clip": motion.name,
    }
    for name, values in _columns([state], made.fps, [made.tasks[_task(motion)]], number, made.frames).items():
        row |= {f"stats/{name}/{what}": value for what, value in _statistics(values).items()}
    made.episodes.append(row)
    made.states.append(state)
    made.frames += frames
    made.bytes += size


def _columns(
    states: list[Float32Array], fps: float, tasks: list[int], first_episode: int, first_frame: int
) -> dict[str, NDArray[Any]]:
    """The columns [n, width] of the data of some episodes in a row, by name."""
    lengths = [len(state) for state in states]
    within = np.concatenate([np.arange(length) for length in lengths])
    columns = {
        "timestamp": within / fps,
        "frame_index": within,
        "episode_index": first_episode + np.repeat(np.arange(len(states)), lengths),
        "index": first_frame + np.arange(sum(lengths)),
        "task_index": np.repeat(tasks, lengths),
    }
    return {
        STATE: np.concatenate(states),
        ACTION: np.concatenate([part for state in states for part in (state[1:], state[-1:])]),
        **{name: values[:, None] for name, values in columns.items()},
    }


def _statistics(values: NDArray[Any]) -> dict[str, list[float]]:
    """What LeRobot keeps of a column [n, width]: a number for each of its width, and how many rows there are."""
    values = values.astype(np.float64)
    found = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
    quantiles = dict(zip(_QUANTILES, np.quantile(values, _QUANTILES, axis=0), strict=True))
    found |= {f"q{round(share * 100):02d}": value for share, value in quantiles.items()}
    return {**{name: value.tolist() for name, value in found.items()}, "count": [len(values)]}


def _features(joints: tuple[str, ...]) -> dict[str, Any]:
    names = [f"root.{axis}" for axis in "xyz"] + [f"{joint}.r{axis}" for joint in joints for axis in "xyz"]
    vector = {"dtype": "float32", "shape": [len(names)], "names": names}
    number = {"shape": [1], "names": None}
    integers = {name: {"dtype": "int64", **number} for name in _INTEGERS}
    return {STATE: vector, ACTION: vector, "timestamp": {"dtype": "float32", **number}, **integers}


def _write_meta(made: _Set, folder: Path) -> None:
    """info.json, stats.json, tasks.parquet and the episodes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    info = {
        "codebase_version": VERSION,
        "robot_type": None,
        "total_episodes": len(made.episodes),
        "total_frames": made.frames,
        "total_tasks": len(made.tasks),
        "chunks_size": _CHUNK,
        "data_files_size_in_mb": _MEGABYTES,
        "video_files_size_in_mb": 200,
        "fps": made.fps,
        "splits": {"train": f"0:{len(made.episodes)}"},
        "data_path": DATA,
        "video_path": None,
        "features": _features(made.joints),
    }
    tasks = [made.tasks[row["tasks"][0]] for row in made.episodes]
    stats = {name: _statistics(values) for name, values in _columns(made.states, made.fps, tasks, 0, 0).items()}
    episodes = folder / EPISODES
    episodes.parent.mkdir(parents=True)
    pq.write_table(pa.Table.from_pylist(made.episodes), episodes)
    pq.write_table(_task_table(list(made.tasks)), folder / "meta/tasks.parquet")
    for name, value in (("stats", stats), ("info", info)):  # a set without info.json is none
        with whole_file(folder / "meta" / f"{name}.json") as stream:
            stream.write(json.dumps(value, ensure_ascii=False, indent=4).encode())


def _task_table(tasks: list[str]) -> Any:
    """Tasks as pandas writes a table whose index they are, which is how LeRobot looks them up."""
    import pyarrow as pa

    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())})
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.2.0"}
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


WRITER: Final = LerobotWriter()

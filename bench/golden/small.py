"""The small golden record: a lake of made clips with pretrained models, for the tests and for any machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench.golden import commands, lakes
from bench.golden.comparing import differences
from bench.golden.contents import lake_entries
from bench.golden.recording import answers, cleaner, configure, told
from bench.golden.serve import Said, say
from tests.samples import (
    KINECT_1,
    KINECT_1_PARENTS,
    deepmimic_frames,
    deepmimic_text,
    kinect_2_from_1,
    mirrored_body,
    npz_bytes,
    ntu_text,
    swinging_body,
)

RECORD: Final = Path(__file__).parents[2] / "tests" / "golden" / "small.json"
RERECORD: Final = "python -m bench.golden small --out tests/golden/small.json"
LIMBS: Final = ((5, 6, 7), (9, 10, 11), (13, 14, 15), (17, 18, 19))  # of KINECT_1
# What fractions may differ by between two machines.
RELATIVE: Final = 2e-3
ABSOLUTE: Final = 2e-4


def small_record(work: Path, cluster: Sequence[str] = ("--workers", "1")) -> dict[str, Any]:
    """Make a small lake in a folder, ask it, and take down what it holds and says; `cluster`: where shards run."""
    work = work.resolve()
    places = {name: str(work / name) for name in ("lake", "own", "src", "out")}
    make_clips(work / "src" / "clips")
    (work / "out").mkdir()
    configure(work / "lake", lakes.SMALL_CONFIG)
    lake, clean = work / "lake", cleaner(work)

    def ask(templates: Mapping[str, str]) -> dict[str, Any]:
        said: dict[str, Said] = {}
        for name, words in told(templates, places, lakes.SMALL_CLIPS, cluster).items():
            said[name] = say(words)
        return answers(said, clean, (*commands.CLOCK_KEYS, "bytes"))

    found: dict[str, Any] = {"command": ask(commands.SMALL_BUILD), **lake_entries(lake, clean, soft=True)}
    found["asked"] = ask(commands.SMALL_ASK)
    exported = (work / "out" / "clip.bvh").read_text(encoding="utf-8").splitlines()
    found["file"] = {"lines": len(exported), "joints": sum("JOINT" in line for line in exported)}
    found["removed"] = {"command": ask(commands.SMALL_REMOVE), "table": lake_entries(lake, clean, soft=True)["table"]}
    return found


def small_differences(old: Any, new: Any) -> list[str]:
    """A line for each entry that differs by more than two machines may."""
    return differences(old, new, relative=RELATIVE, absolute=ABSOLUTE)


def make_clips(folder: Path) -> None:
    """Three made clips of each of three formats, with labels. Coordinates are rounded: bytes are the same anywhere."""
    labels = ["file,label,subject"]
    for i in range(3):
        body = _body(60 + 15 * i, i).round(5)
        mirrored = kinect_2_from_1(mirrored_body(_body(70 + 11 * i, i + 3))).round(5)
        contents = {
            f"kinect/a{i}.npz": npz_bytes(body, KINECT_1, KINECT_1_PARENTS, 30.0),
            f"ntu/b{i}.skeleton": ntu_text([(str(i), 0, mirrored)]).encode(),
            f"deepmimic/c{i}.txt": deepmimic_text(deepmimic_frames(70 + 19 * i).round(5)).encode(),
        }
        for name, content in contents.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
            labels.append(f"{name},{name[:3]},{i % 2}")
    (folder / "labels.csv").write_text("\n".join(labels) + "\n", encoding="utf-8")


def _body(count: int, number: int) -> NDArray[np.float64]:
    """A body that swings its limbs at a pace and in a direction of its own: no two clips are alike, and none ties."""
    body = swinging_body(count)
    times = np.arange(count) / 30.0
    for limb, joints in enumerate(LIMBS):
        pace, turn = 0.6 + 0.23 * number + 0.17 * limb, 1.1 * number + 0.7 * limb
        swing = 0.22 * np.sin(2.0 * np.pi * pace * times + turn)
        direction = np.array([np.sin(turn), np.cos(turn), np.sin(2.0 * turn)])
        for reach, joint in enumerate(joints, start=1):
            body[:, joint] += reach / len(joints) * swing[:, None] * direction
    return body

"""Motion as a browser draws it: positions of joints in sixteen bits each, and which feet stand.

A block is little-endian: "MLM1", uint32 joints J, uint32 frames F, float32 frames a second, float32 scale (metres),
float32 origin[3]; int16 [F, J, 3], of which a position is origin + scale x value; uint8 [F], of which bit 0 says that
the left foot stands, bit 1 the right one. At 30 frames a second that is 3.8 kB a second.
"""

from __future__ import annotations

import struct
from collections import OrderedDict, defaultdict
from collections.abc import Sequence
from pathlib import Path
from threading import Lock
from typing import Annotated, Any, Final

import numpy as np
from fastapi import APIRouter, Query, Request, Response
from motionlake.arrays import Float64Array, FloatArray
from motionlake.lake.frames import PLACES, frame_range, from_table, read_rows
from motionlake.lake.integrity import sound
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS
from motionlake.service.errors import ServiceError
from motionlake.service.served import Served, Serving

MAGIC: Final = b"MLM1"
_HEAD: Final = struct.Struct("<4sIIff3f")
_STEPS: Final = 32_000  # of int16 that are used, to either side
_FINEST: Final = 1e-5  # metres a step
MOST_THUMBNAILS: Final = 64
_THUMBNAIL_SECONDS: Final = 2.0
_THUMBNAIL_FPS: Final = 15.0
_KEPT: Final = 30_000  # thumbnails in memory, 4 kB each
MOST_SECONDS: Final = 3600.0
BINARY: Final = "application/octet-stream"
HEIGHT: Final = 1.75  # metres of the body that the radii are of
# Radius of the bone that ends at a joint, as a share of the body's height.
_THICK: Final = {
    "hips": 0.058, "spine": 0.058, "chest": 0.062, "neck": 0.03, "head": 0.055, "clavicle": 0.032, "shoulder": 0.034,
    "elbow": 0.026, "wrist": 0.02, "hip": 0.05, "knee": 0.042, "ankle": 0.03, "toe": 0.022,
}  # fmt: skip

router = APIRouter(prefix="/api", tags=["motion"])
Clip = Annotated[str, Query(max_length=2000, description="Full name of a clip.")]
Frame = Annotated[int | None, Query(ge=0, le=2**40, description="Frame, at the clip's own rate.")]


def packed(positions: FloatArray, fps: float, stands: np.ndarray[Any, Any]) -> bytes:
    """A block of positions [F, J, 3], metres, with [F, 2] which feet stand."""
    places = np.asarray(positions, np.float64)
    low, high = places.min(axis=(0, 1)), places.max(axis=(0, 1))
    origin = np.asarray((low + high) / 2, np.float32)
    scale = np.float32(max(float((high - low).max()) / 2 / _STEPS, _FINEST))
    values = np.round((places - origin.astype(np.float64)) / float(scale)).astype("<i2")
    head = _HEAD.pack(MAGIC, places.shape[1], len(places), fps, scale, *origin.tolist())
    feet = (stands[:, 0] | stands[:, 1] << 1).astype(np.uint8)
    return b"".join((head, values.tobytes(), feet.tobytes()))


def unpacked(block: bytes) -> tuple[Float64Array, float, np.ndarray[Any, Any]]:
    """Positions [F, J, 3], frames a second and [F, 2] which feet stand, of a block.

    Raises:
        ValueError: it is no block.
    """
    if len(block) < _HEAD.size:
        raise ValueError("is no block of motion: too short")
    magic, joints, frames, fps, scale, *origin = _HEAD.unpack_from(block)
    if magic != MAGIC or len(block) != _HEAD.size + frames * (joints * 6 + 1):
        raise ValueError("is no block of motion")
    values = np.frombuffer(block, "<i2", frames * joints * 3, _HEAD.size).reshape(frames, joints, 3)
    feet = np.frombuffer(block, np.uint8, frames, _HEAD.size + values.nbytes)
    return np.array(origin) + scale * values.astype(np.float64), fps, np.stack([feet & 1, feet >> 1], axis=1) > 0


def positions_of(served: Served, clips: Sequence[str]) -> dict[str, tuple[FloatArray, float]]:
    """Positions [F, 21, 3] and frames a second of clips, each part of the lake read once."""
    parts: dict[tuple[str, str], list[str]] = defaultdict(list)
    for row in served.shelf.of(clips):
        parts[row["dataset"], row["part"]].append(row["clip"])
    found: dict[str, tuple[FloatArray, float]] = {}
    for (dataset, part), members in parts.items():
        path = sound(served.lake, served.lake.frames_part(dataset, part))
        for clip, rows in read_rows(path, members, ("fps", *PLACES)):
            frames = from_table(clip, rows)
            found[clip] = frames.positions, frames.fps
    return found


def block_of(positions: FloatArray, fps: float, most_fps: float) -> bytes:
    """A block of motion at no more frames a second than are asked for: every so manieth frame."""
    from motionlake.motion.standing import contacts  # compilers are imported when motion is first asked for

    height = height_of(positions)
    stands = contacts(np.asarray(positions, np.float64), fps, height)
    step = max(1, int(np.ceil(fps / most_fps - 1e-3)))
    return packed(positions[::step], fps / step, stands[::step])


def height_of(positions: FloatArray) -> float:
    """About the height of the standing body, metres: twice its leg and a bit, whatever its pose."""
    legs = [[INDEX[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle")] for side in ("left", "right")]
    bones = np.linalg.norm(np.diff(np.asarray(positions, np.float64)[:, legs], axis=2), axis=-1).mean(axis=0)
    return max(float(bones.sum()) / 2 * 2.05, 1e-3)


@router.get("/skeleton")
def skeleton() -> dict[str, list[Any]]:
    """The canonical skeleton, which all motion is on."""
    radii = [round(HEIGHT * _THICK[name.split("_")[-1]], 4) for name in JOINTS]
    return {"joints": list(JOINTS), "parents": list(PARENTS), "radii": radii}


@router.get("/clip/motion", response_class=Response)
def motion(
    request: Request,
    clip: Clip = "",
    made: Annotated[str, Query(max_length=100, description="In place of a clip: id of a made motion.")] = "",
    upload: Annotated[str, Query(max_length=64, description="In place of a clip: id of a file searched by.")] = "",
    first: Annotated[int | None, Query(alias="from", ge=0, le=2**40, description="First frame.")] = None,
    last: Annotated[int | None, Query(alias="to", ge=0, le=2**40, description="Frame after the last.")] = None,
    fps: Annotated[float, Query(gt=0, le=240, description="Frames a second at most.")] = 30.0,
) -> Response:
    """The motion of a clip, or of its frames [from, to), as a binary block."""
    serving: Serving = request.app.state.serving
    if upload:
        positions, rate = _of_file(serving, request.app.state.uploads.path(upload))
    else:
        positions, rate = request.app.state.made.motion(made) if made else _whole(serving.now(), clip)
    start, stop = frame_range(upload or made or clip, first, last, len(positions))
    if (stop - start) / rate > MOST_SECONDS:
        raise ServiceError(413, f"{clip or made}: ask for {MOST_SECONDS:g} s at most, by from and to")
    return Response(block_of(positions[start:stop], rate, fps), media_type=BINARY)


def _whole(served: Served, clip: str) -> tuple[FloatArray, float]:
    return positions_of(served, [clip])[clip]


def _of_file(serving: Serving, path: Path) -> tuple[FloatArray, float]:
    from motionlake.stages.frames import first_body

    body, motion = first_body(serving.lake, path)
    return motion.positions, body.fps


class Thumbnails:
    """Short loops of clips, the last ones kept."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[str, str], bytes] = OrderedDict()
        self._lock = Lock()

    def of(self, served: Served, clips: Sequence[str]) -> list[bytes]:
        """A block a clip, in their order."""
        with self._lock:
            known = {clip: self._kept.get((served.generation, clip)) for clip in clips}
        missing = [clip for clip, block in known.items() if block is None]
        made = {clip: _loop(*found) for clip, found in positions_of(served, missing).items()} if missing else {}
        with self._lock:
            for clip, block in made.items():
                self._kept[served.generation, clip] = block
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
        return [made.get(clip) or known[clip] or b"" for clip in clips]


def _loop(positions: FloatArray, fps: float) -> bytes:
    """The two seconds from the middle of a clip: takes often begin and end with standing."""
    count = max(1, round(_THUMBNAIL_SECONDS * fps))
    start = max(0, (len(positions) - count) // 2)
    return block_of(positions[start : start + count], fps, _THUMBNAIL_FPS)


@router.get("/thumbnails", response_class=Response)
def thumbnails(
    request: Request, clip: Annotated[list[str], Query(max_length=MOST_THUMBNAILS, description="Up to 64 clips.")]
) -> Response:
    """Short loops of several clips: uint32 count, then of each uint32 length and its block."""
    serving: Serving = request.app.state.serving
    blocks = request.app.state.thumbnails.of(serving.now(), clip)
    framed = b"".join(struct.pack("<I", len(block)) + block for block in blocks)
    return Response(struct.pack("<I", len(blocks)) + framed, media_type=BINARY)

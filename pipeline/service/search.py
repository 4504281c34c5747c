"""Search by a clip, by a range of one, or by a file that is dropped on the page; and how two motions are aligned."""

from __future__ import annotations

import re
import shutil
import tempfile
import time
import uuid
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from threading import Lock
from typing import Annotated, Any, Final, Literal

import numpy as np
from fastapi import APIRouter, Body, Query, Request
from motionlake.arrays import Float32Array, FloatArray
from motionlake.lake.frames import frame_range
from motionlake.motion.skeleton import body_poses
from motionlake.names import safe_name
from motionlake.retrieval.fused import FusedSearcher
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import Finds, Scope
from motionlake.retrieval.protocol import Query as Asked
from motionlake.service.errors import ServiceError
from motionlake.service.motion import Clip, Frame, positions_of
from motionlake.service.served import Served, serving_of
from pydantic import BaseModel, ConfigDict, Field

router = APIRouter(prefix="/api", tags=["search"])
MOST: Final = 200  # answers
AMONG: Final = 300  # answers that a condition is asked of
UPLOADS: Final = 20  # files that are kept
ALIGNED: Final = 3000  # frames of either motion of an alignment
PATHS_FPS: Final = 15.0
_ID: Final = re.compile(r"[0-9a-f]{32}")


class SearchRequest(BaseModel):
    """What is looked for."""

    model_config = ConfigDict(extra="forbid")
    clip: str | None = Field(None, max_length=2000)
    upload: str | None = Field(None, max_length=64)
    first: int | None = Field(None, alias="from", ge=0, le=2**40)
    last: int | None = Field(None, alias="to", ge=0, le=2**40)
    method: str = Field("default", max_length=40)
    finds: Literal["clip", "range"] | None = None
    k: int = Field(20, ge=1, le=MOST)
    mirrored: bool = False
    recorded_only: bool = False
    joints: bool = Field(False, description="Which joints are how far apart, by the default method; twice as slow.")
    dataset: str | None = Field(None, max_length=200)
    where: str | None = Field(None, max_length=4000)


class Uploads:
    """Clip files that people search by: kept while the service runs, outside of the lake."""

    def __init__(self) -> None:
        self._folder: Path | None = None
        self._files: OrderedDict[str, Path] = OrderedDict()
        self._lock = Lock()

    def add(self, name: str, content: bytes) -> tuple[str, Path]:
        """Keep a file; the oldest one goes where there are too many."""
        with self._lock:
            if self._folder is None:
                self._folder = Path(tempfile.mkdtemp(prefix="motionlake-uploads-"))
            found = uuid.uuid4().hex
            path = self._folder / found / safe_name(Path(name).name)
            path.parent.mkdir()
            path.write_bytes(content)
            self._files[found] = path
            while len(self._files) > UPLOADS:
                _, oldest = self._files.popitem(last=False)
                shutil.rmtree(oldest.parent, ignore_errors=True)
            return found, path

    def path(self, upload: str) -> Path:
        """Where a file lies. Raises `ServiceError` where there is none of such an id."""
        if not _ID.fullmatch(upload) or upload not in self._files:
            raise ServiceError(404, "upload: there is none of this id any more; drop the file again")
        return self._files[upload]

    def remove(self, upload: str) -> None:
        """Forget a file."""
        path = self._files.pop(upload, None)
        if path is not None:
            shutil.rmtree(path.parent, ignore_errors=True)

    def close(self) -> None:
        """Remove all of them."""
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)


@router.post("/search")
def search(request: Request, asked: SearchRequest) -> dict[str, Any]:
    """The clips, or the ranges inside them, that are most like a clip, a range of it, or a file."""
    served = serving_of(request).now()
    if (asked.clip is None) == (asked.upload is None):
        raise ServiceError(400, "search: name a clip, or an upload")
    if asked.clip is not None:
        row = served.shelf.of([asked.clip])[0]
        source: str | Path = asked.clip
        if asked.first is not None or asked.last is not None:
            frame_range(asked.clip, asked.first, asked.last, row["frames"])
    else:
        source = request.app.state.uploads.path(asked.upload)
    started = time.perf_counter()
    hits = served.answered(
        asked.model_dump_json(), lambda: found(served, Asked(source, asked.first, asked.last), asked)
    )
    return {"hits": [_row(hit) for hit in hits], "ms": round((time.perf_counter() - started) * 1000, 2)}


def found(served: Served, query: Asked, asked: SearchRequest) -> list[Hit]:
    """The answers to a query."""
    finds: Finds = asked.finds or ("clip" if query.whole else "range")
    method = "fused" if asked.method == "default" else asked.method
    among = served.clips_of_condition(asked.where) if asked.where and asked.where.strip() else None
    scope = Scope(asked.dataset, recorded_only=asked.recorded_only, mirrored=asked.mirrored)
    how = {"explain": True, "matched": asked.joints} if (finds, method) == ("clip", "fused") else {}
    searcher = served.searcher(finds, method, **how)
    with served.searching(alone=not (isinstance(searcher, FusedSearcher) and searcher.beside_others(query, scope))):
        (hits,) = searcher.search([query], asked.k if among is None else max(AMONG, asked.k), scope)
    kept = [hit for hit in hits if among is None or hit.clip in among]
    return kept[: asked.k]


def _row(hit: Hit) -> dict[str, Any]:
    shares = {share.method: round(share.near, 4) for share in hit.shares or ()}
    joints = next((share.match.joints for share in hit.shares or () if share.match is not None), {})
    row = {
        "clip": hit.clip, "from": hit.start, "to": hit.stop, "distance": round(hit.distance, 6),
        "mirrored": hit.mirrored, "label": hit.label, "dataset": hit.dataset, "seconds": round(hit.seconds, 3),
        "explanation": shares,
    }  # fmt: skip
    if joints:
        row["joints"] = {name: round(float(apart), 4) for name, apart in joints.items()}
    return row


@router.post("/uploads")
def upload(
    request: Request,
    name: Annotated[str, Query(min_length=1, max_length=200, description="Name of the file, with its suffix.")],
    content: Annotated[bytes, Body(media_type="application/octet-stream")],
) -> dict[str, Any]:
    """Keep a clip file to search by, while the service runs; the body is the file itself."""
    from motionlake.stages.frames import first_body

    uploads: Uploads = request.app.state.uploads
    found, path = uploads.add(name, content)
    try:
        body, motion = first_body(serving_of(request).lake, path)
    except Exception as error:
        uploads.remove(found)
        raise ServiceError(422, _without_folder(str(error), path)) from error
    return {"id": found, "name": path.name, "frames": len(motion.positions), "fps": body.fps, "rig": _rig(body)}


def _rig(body: Any) -> str | None:
    return str(getattr(body, "rig", "")) or None


def _without_folder(text: str, path: Path) -> str:
    return text.replace(str(path), path.name)


@router.get("/align")
def align(
    request: Request,
    clip: Clip,
    other: Clip,
    first: Annotated[int | None, Query(alias="from", ge=0, le=2**40)] = None,
    last: Annotated[int | None, Query(alias="to", ge=0, le=2**40)] = None,
    other_from: Frame = None,
    other_to: Frame = None,
) -> dict[str, Any]:
    """Which frames of two motions belong together, by dynamic time warping of poses; each at its own rate."""
    from motionlake.motion.dtw import clip_path

    served = serving_of(request).now()
    poses = positions_of(served, list({clip, other}))
    a, a_frames = _poses(clip, *poses[clip], first, last)
    b, b_frames = _poses(other, *poses[other], other_from, other_to)
    path = clip_path(a, b)
    return {"path": np.column_stack([a_frames[path[:, 0]], b_frames[path[:, 1]]]).tolist()}


def _poses(
    name: str, positions: FloatArray, fps: float, first: int | None, last: int | None
) -> tuple[Float32Array, np.ndarray[Any, Any]]:
    """[n, 63] poses seen from the body, some a second, and the frames that they are of."""
    start, stop = frame_range(name, first, last, len(positions))
    frames = np.arange(start, stop, max(1, round(fps / PATHS_FPS)))
    if len(frames) > ALIGNED:
        raise ServiceError(413, f"{name}: {len(frames) / PATHS_FPS:.0f} s are too long to align; choose a range")
    poses = body_poses(positions[frames]).reshape(len(frames), -1)
    return poses.astype(np.float32), frames


def nearest(served: Served, clip: str, k: int) -> list[dict[str, Any]]:
    """The clips nearest to one by the default search; none where the lake is not ready for it."""
    from motionlake.errors import UserError

    try:
        hits: Sequence[Hit] = found(served, Asked(clip), SearchRequest(clip=clip, k=k))  # type: ignore[call-arg]
    except UserError:
        return []
    return [_row(hit) for hit in hits]

"""Files out of the lake, and new motion: what people take away from a selection."""

from __future__ import annotations

import shutil
import tempfile
import uuid
import zipfile
from collections import OrderedDict
from pathlib import Path
from threading import Lock
from typing import Any, Final

import numpy as np
from fastapi import APIRouter, Request
from fastapi.responses import FileResponse
from motionlake.arrays import FloatArray
from motionlake.lake.catalog import reading
from motionlake.lake.frames import frame_range
from motionlake.retrieval.selection import ClipRange, once
from motionlake.service.errors import ServiceError
from motionlake.service.served import Served, annotations_of, serving_of
from pydantic import BaseModel, ConfigDict, Field
from starlette.background import BackgroundTask

router = APIRouter(prefix="/api", tags=["making"])
EXPORTED: Final = 2000  # clips of one archive
EXPORTED_SECONDS: Final = 4 * 3600.0
MADE: Final = 100  # made motions that are kept
_GATE: Final = Lock()  # one export at a time


class ExportedClip(BaseModel):
    """A clip, or frames [from, to) of it."""

    model_config = ConfigDict(extra="forbid")
    clip: str = Field(max_length=2000)
    first: int | None = Field(None, alias="from", ge=0, le=2**40)
    last: int | None = Field(None, alias="to", ge=0, le=2**40)


class ExportRequest(BaseModel):
    """Clips, and the format that they leave in."""

    model_config = ConfigDict(extra="forbid")
    clips: list[ExportedClip] = Field(min_length=1, max_length=EXPORTED)
    format: str = Field("bvh", max_length=40)


class SynthesisRequest(BaseModel):
    """New motion of classes, or like some clips."""

    model_config = ConfigDict(extra="forbid")
    classes: str | list[str] = Field(default_factory=list, alias="class")
    like: list[str] = Field(default_factory=list, max_length=20)
    seconds: float = Field(6.0, gt=0, le=60)
    count: int = Field(1, ge=1, le=8)
    seed: int = Field(0, ge=0, le=2**31)


def formats() -> list[str]:
    """The formats that clips leave in."""
    from motionlake.formats.write.registry import set_writers, writers

    return sorted({**writers(), **set_writers()})


@router.post("/export", response_class=FileResponse)
def export(request: Request, asked: ExportRequest) -> FileResponse:
    """Clips as files of a format, with their manifest, in a zip archive."""
    served = serving_of(request).now()
    rows = served.shelf.of([each.clip for each in asked.clips])
    chosen = once(ClipRange(each.clip, each.first, each.last) for each in asked.clips)
    seconds = 0.0
    for each, row in zip(asked.clips, rows, strict=True):
        start, stop = frame_range(each.clip, each.first, each.last, row["frames"])
        seconds += (stop - start) / row["fps"]
    if seconds > EXPORTED_SECONDS:
        raise ServiceError(413, f"export: {seconds / 3600:.1f} hours are too much; `motionlake export` takes all")
    if asked.format not in formats():
        raise ServiceError(400, f"format: is one of {', '.join(formats())}")
    folder = Path(tempfile.mkdtemp(prefix="motionlake-export-"))
    try:
        with _GATE:
            archive = _archive(served, chosen, asked.format, folder)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    gone = BackgroundTask(shutil.rmtree, folder, ignore_errors=True)
    return FileResponse(archive, media_type="application/zip", filename=f"{asked.format}.zip", background=gone)


def _archive(served: Served, chosen: list[ClipRange], form: str, folder: Path) -> Path:
    from motionlake.formats.write.registry import SetWriter, Writer, set_writers, writers
    from motionlake.retrieval.export import ClipExporter, Treatment, target_of
    from motionlake.retrieval.export_files import export_files, export_set

    known: dict[str, Writer | SetWriter] = {**writers(), **set_writers()}
    writer = known[form]
    rate = getattr(writer, "fps", None)
    treatment = Treatment(target_of(served.lake, writer.rig or "own"), rate, False, as_is=writer.rig)
    with reading(served.lake) as con:
        exporter = ClipExporter(con, served.lake, treatment)
        if isinstance(writer, SetWriter):
            done = export_set(exporter, chosen, writer, folder / "files", _untold)
        else:
            done = export_files(exporter, chosen, writer, folder / "files", _untold)
    if not done.rows:
        raise ServiceError(422, f"nothing was written: {done.failed[0]['reason'] if done.failed else 'no clip'}")
    archive = folder / "clips.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=3) as packed:
        for path in sorted(path for path in (folder / "files").rglob("*") if path.is_file()):
            packed.write(path, path.relative_to(folder / "files"))
    return archive


def _untold(done: int, total: int) -> None:
    """Nobody is told how far an export is."""


class Made:
    """Motion that was made for people to look at; nothing of it is in the lake."""

    def __init__(self) -> None:
        self._kept: OrderedDict[str, tuple[FloatArray, float]] = OrderedDict()

    def add(self, positions: FloatArray, fps: float) -> str:
        """Keep a motion; the oldest one goes where there are too many."""
        found = uuid.uuid4().hex
        self._kept[found] = np.asarray(positions, np.float32), fps
        while len(self._kept) > MADE:
            self._kept.popitem(last=False)
        return found

    def motion(self, made: str) -> tuple[FloatArray, float]:
        """Its positions and frames a second. Raises `ServiceError` where there is none of this id."""
        if made not in self._kept:
            raise ServiceError(404, "made: there is none of this id any more; make it again")
        return self._kept[made]


@router.post("/synthesize")
def synthesize(request: Request, asked: SynthesisRequest) -> dict[str, Any]:
    """New motion, which is not entered into the lake; its motion is read by `/api/clip/motion?made=ID`."""
    served = serving_of(request).now()
    labels = {each.clip: each.value for each in annotations_of(request).current(kind="label") if each.start is None}
    classes = [asked.classes] if isinstance(asked.classes, str) else list(asked.classes)
    start = None
    if asked.like:
        rows = served.shelf.of(asked.like)
        start = asked.like[0]
        classes = classes or list(
            dict.fromkeys(filter(None, (row["label"] or labels.get(row["clip"]) for row in rows)))
        )
    if not classes:
        raise ServiceError(400, "synthesize: name a class, or clips that have a label")
    found = []
    for number in range(asked.count):
        with served.searching():
            motion = served.api().synthesize(classes, asked.seconds, seed=asked.seed + number, start=start)
        made = request.app.state.made.add(motion.positions, motion.fps)
        found.append({"id": made, "classes": classes, "frames": len(motion.positions), "fps": motion.fps,
                      "seed": asked.seed + number, "source": start})  # fmt: skip
    return {"clips": found}

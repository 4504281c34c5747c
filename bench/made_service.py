"""A service of made clips that answers as `motionlake browse` does: for measuring the browser application alone."""

from __future__ import annotations

import gzip
import json
import math
import struct
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS

CSP: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
LABELS: Final = ("walk", "run", "jump", "kick", "dance", "sit", "throw", "punch", "wave", "")
DATASETS: Final = ("north", "south", "east")
TYPES: Final = {"html": "text/html", "js": "text/javascript", "css": "text/css", "svg": "image/svg+xml"}
SCALE: Final = 0.001
STEP: Final = 15.0


class MadeLake:
    """`clips` made rows; row i is the same in every lake."""

    def __init__(self, clips: int) -> None:
        self.clips = clips
        self.order: dict[str, list[int]] = {}
        self.rows = [self.row(i) for i in range(clips)]
        self.counts = self.facets()
        self.chosen({})

    def row(self, i: int) -> dict[str, Any]:
        frames = 60 + (i * 7919) % 900
        return {
            "clip": f"{DATASETS[i % 3]}/take{i:06d}", "dataset": DATASETS[i % 3], "label": LABELS[(i // 7) % 10],
            "subject": f"s{i % 40:02d}", "rig": ("bvh", "amc", "npz")[i % 3], "frames": frames, "fps": 30.0,
            "seconds": frames / 30, "licence": "CC BY 4.0",
            "synthetic": i % 50 == 0, "quality": ("ok", "doubtful", "bad")[i * 31 % 3],
            "tags": ["checked"] if i % 11 == 0 else [],
        }  # fmt: skip

    def chosen(self, query: Mapping[str, list[str]]) -> list[int]:
        """The clips of a query, in its order."""
        wanted = {name: query[name] for name in ("dataset", "label") if name in query}
        text = query.get("text", [""])[0]
        sort = query.get("sort", ["clip"])[0]
        key = json.dumps([wanted, text, sort, query.get("descending")])
        if key not in self.order:
            rows = [
                (i, r)
                for i, r in enumerate(self.rows)
                if text in r["clip"] and all(r[n] in v for n, v in wanted.items())
            ]
            rows.sort(key=lambda pair: pair[1].get(sort) or 0, reverse="descending" in query)
            self.order[key] = [i for i, _ in rows]
        return self.order[key]

    def facets(self) -> dict[str, Any]:
        rows = self.rows
        columns = ("dataset", "label", "subject", "rig", "licence", "synthetic", "quality")
        counts: dict[str, Any] = {}
        for column in columns:
            values, numbers = np.unique([str(row[column]) for row in rows], return_counts=True)
            counts[column] = [{"value": str(v), "clips": int(n)} for v, n in zip(values, numbers, strict=True)]
        numbers, edges = np.histogram([row["seconds"] for row in rows], np.arange(0, 36, 4.0))
        spans = zip(edges[:-1], edges[1:], numbers, strict=True)
        counts["length"] = [{"from": float(a), "to": float(b), "clips": int(n)} for a, b, n in spans]
        return {**counts, "tags": [{"value": "checked", "clips": sum(1 for row in rows if row["tags"])}]}


def walking(frames: int, fps: float, phase: float) -> Float64Array:
    """Places [F, 21, 3], in metres, of a body that walks on the spot."""
    rest = {
        "hips": (0, 0.95, 0), "spine": (0, 1.08, 0), "chest": (0, 1.25, 0), "neck": (0, 1.48, 0), "head": (0, 1.62, 0),
        "clavicle": (0.06, 1.42, 0), "shoulder": (0.19, 1.42, 0), "elbow": (0.22, 1.15, 0), "wrist": (0.22, 0.9, 0.05),
        "hip": (0.1, 0.92, 0), "knee": (0.1, 0.5, 0.02), "ankle": (0.1, 0.09, 0), "toe": (0.1, 0.03, 0.15),
    }  # fmt: skip
    places = np.zeros((frames, len(JOINTS), 3))
    turn = 2 * math.pi * np.arange(frames) / fps + phase
    for name, joint in INDEX.items():
        side = {"left": 1.0, "right": -1.0}.get(name.split("_")[0], 1.0)
        places[:, joint] = np.multiply(rest[name.split("_")[-1]], (side, 1, 1))
        swing = {"elbow": -0.12, "wrist": -0.3, "knee": 0.18, "ankle": 0.32, "toe": 0.32}.get(name.split("_")[-1], 0)
        if swing:
            places[:, joint, 2] += side * swing * np.sin(turn)
            places[:, joint, 1] += 0.2 * abs(swing) * np.maximum(0, side * np.cos(turn))
    return places


@cache
def motion(number: int, frames: int, fps: float) -> bytes:
    """The block `MLM1` of a made clip."""
    places = walking(frames, fps, number % 13)
    steps = np.round(places / SCALE).astype("<i2")
    head = b"MLM1" + struct.pack("<IIff3f", len(JOINTS), frames, fps, SCALE, 0.0, 0.0, 0.0)
    turn = 2 * math.pi * np.arange(frames) / fps + number % 13
    contacts = (np.cos(turn) < 0) * 1 + (np.cos(turn) >= 0) * 2
    return bytes(head + steps.tobytes() + contacts.astype(np.uint8).tobytes())


def number_of(clip: str) -> int:
    return int("".join(c for c in clip if c.isdigit()) or 0)


class Handler(BaseHTTPRequestHandler):
    lake: MadeLake
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        query = parse_qs(parts.query, keep_blank_values=True)
        if not parts.path.startswith("/api/"):
            name = parts.path.lstrip("/") or "index.html"
            found = files("motionlake.service") / "bundle"
            for part in name.split("/"):
                found = found / part
            return self.answer(found.read_bytes(), TYPES.get(name.rpartition(".")[2], "text/plain"))
        made = self.made(parts.path.removeprefix("/api/"), query)
        if isinstance(made, bytes):
            return self.answer(made, "application/octet-stream")
        return self.answer(json.dumps(made).encode(), "application/json")

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers.get("Content-Length", 0)))
        self.answer(b'{"error": "made clips alone: nothing can be changed"}', "application/json", 403)

    def made(self, path: str, query: dict[str, list[str]]) -> Any:
        clip = query.get("clip", [""])[0]
        if path == "lake":
            return {
                "name": "made", "version": "0", "clips": self.lake.clips, "seconds": self.lake.clips * 17.0,
                "datasets": list(DATASETS), "facets": [], "exports": ["bvh"], "read_only": True, "generation": 1,
                "search_methods": [{"name": "default", "title": "Default", "finds": "clip", "ready": True}],
            }  # fmt: skip
        if path == "clips":
            chosen = self.lake.chosen(query)
            offset, limit = int(query.get("offset", ["0"])[0]), int(query.get("limit", ["100"])[0])
            rows = [self.lake.rows[i] for i in chosen[offset : offset + limit]]
            return {"total": len(chosen), "offset": offset, "clips": rows}
        if path == "facets":
            return self.lake.counts
        if path == "skeleton":
            return {"joints": JOINTS, "parents": PARENTS, "radii": [0.05] * len(JOINTS)}
        if path == "thumbnails":
            blocks = [motion(number_of(name) % 97, 24, STEP) for name in query["clip"]]
            return struct.pack("<I", len(blocks)) + b"".join(struct.pack("<I", len(b)) + b for b in blocks)
        if path == "clip/motion":
            return motion(number_of(clip) % 97, self.lake.row(number_of(clip))["frames"], 30.0)
        if path == "clip/timeline":
            frames = self.lake.row(number_of(clip))["frames"]
            spans = [
                {"start": a, "stop": min(frames, a + 30), "value": str(n % 7), "colour_index": n % 7, "text": ""}
                for n, a in enumerate(range(0, frames, 30))
            ]  # fmt: skip
            return {"frames": frames, "fps": 30.0, "bands": [{"name": "segments", "spans": spans}]}
        if path == "clip":
            row = self.lake.row(number_of(clip))
            return {**row, "lineage": {}, "licence": {}, "labels": {}, "faults": [], "annotations": [], "near": []}
        return {}

    def answer(self, body: bytes, kind: str, status: int = 200) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Security-Policy", CSP)
        if len(body) > 1024 and "gzip" in self.headers.get("Accept-Encoding", ""):
            body = gzip.compress(body, 1)
            self.send_header("Content-Encoding", "gzip")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Nothing: requests are many."""


@contextmanager
def made_service(clips: int, port: int = 0) -> Iterator[str]:
    """The address of a service of made clips, until the block ends."""
    handler = type("MadeHandler", (Handler,), {"lake": MadeLake(clips)})
    server = ThreadingHTTPServer(("127.0.0.1", port), handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()

"""A service that twenty people search at once: `python -m bench.service_load`.

The service runs in a process of its own, over a lake of 150,000 clips (`bench.large_lakes`; `--folder` as of
`bench.scale_search` keeps it). Each user asks for the clips like one, waits for the answer, looks at it for a while (an
exponential time of some mean) and asks for the next. No clip is asked for twice: the service would know the answer.
Milliseconds from the call to the answer, and what memory the service holds: its own, and with the files that it maps.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import random
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final

import numpy as np
import psutil
from motionlake.lake.layout import Lake

from bench.large_lakes import large_lake
from bench.record import record, recordings
from bench.scale_search import CLIPS, drawn, kept_folder, shortlist

USERS: Final = 20
LOOKS: Final = (2.0, 1.0)  # mean seconds that a user looks at an answer
SECONDS: Final = 60.0
ANSWERS: Final = 20
READY: Final = 10.0  # seconds in which a service of such a lake has read and checked what searches need
WARMING: Final = 10
BARS: Final = {"p95_ms": 150.0, "mib": 3072.0}
PATIENCE: Final = 120.0  # seconds until the service answers at all


@dataclass(frozen=True)
class Service:
    """Where a service answers, and its process."""

    address: str
    token: str
    process: int

    def search(self, clip: str) -> float:
        """Milliseconds that the clips like one take to come."""
        asked = json.dumps({"clip": clip, "k": ANSWERS}).encode()
        headers = {"Authorization": f"Bearer {self.token}", "Content-Type": "application/json"}
        started = time.perf_counter()
        with urllib.request.urlopen(
            urllib.request.Request(f"{self.address}/api/search", asked, headers), timeout=PATIENCE
        ) as reply:
            found = json.loads(reply.read())
        assert found["hits"], clip
        return 1e3 * (time.perf_counter() - started)

    def memory(self) -> dict[str, float]:
        """MiB, of its own, and with the files that it maps."""
        held = psutil.Process(self.process).memory_info()
        return {"own": (held.rss - held.shared) / 2**20, "with_files": held.rss / 2**20}


@contextmanager
def served(lake: Path) -> Iterator[Service]:
    """A service over a lake, while the block lasts."""
    words = [sys.executable, "-m", "motionlake.cli.main", "browse", "--no-open", "--json", "--port", "0"]
    process = subprocess.Popen(
        [*words, "--lake", str(lake)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=os.environ
    )
    try:
        assert process.stdout is not None
        lines = iter(process.stdout.readline, "")
        said = json.loads("".join(itertools.takewhile(lambda line: line.rstrip() != "}", lines)) + "}")
        yield Service(said["address"].partition("/?")[0], said["token"], process.pid)
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=30)


def at_once(service: Service, clips: Sequence[str], look: float, users: int, seconds: float) -> dict[str, Any]:
    """What searches take while so many people ask."""
    waiting: SimpleQueue[str] = SimpleQueue()
    for clip in clips:
        waiting.put(clip)
    end = time.perf_counter() + seconds

    def user(number: int) -> list[float]:
        rng, found = random.Random(number), []
        time.sleep(rng.random() * look)
        while time.perf_counter() < end:
            try:
                found.append(service.search(waiting.get_nowait()))
            except Empty:
                break
            time.sleep(rng.expovariate(1 / look))
        return found

    with ThreadPoolExecutor(users) as pool:
        times = np.concatenate([np.array(found) for found in pool.map(user, range(users))])
    return {
        "users": users, "look_seconds": look, "searches": len(times), "a_second": round(len(times) / seconds, 1),
        "median_ms": round(float(np.median(times)), 1), "p95_ms": round(float(np.quantile(times, 0.95)), 1),
        "longest_ms": round(float(times.max()), 1),
    }  # fmt: skip


def measure(lake: Lake, users: int, looks: Sequence[float], seconds: float) -> dict[str, Any]:
    """All figures."""
    most = int(sum(users * seconds / look for look in looks) * 1.3) + WARMING
    clips = drawn(lake, most, 0)
    figures: dict[str, Any] = {"bars": BARS, "load": round(os.getloadavg()[0], 1)}
    with served(lake.root) as service:
        time.sleep(READY)
        alone = [service.search(clip) for clip in clips[:WARMING]]
        figures["alone_ms"] = round(float(np.median(alone[WARMING // 2 :])), 1)
        shares = np.array_split(np.array(clips[WARMING:], dtype=object), len(looks))
        figures["at_once"] = [
            at_once(service, share.tolist(), look, users, seconds) for share, look in zip(shares, looks, strict=True)
        ]
        figures["mib"] = {name: round(value) for name, value in service.memory().items()}
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=CLIPS)
    parser.add_argument("--processes", type=int, default=2, help="that make the lake")
    parser.add_argument("--folder", type=Path, help="keeps the lake, and takes the one that lies there (default: none)")
    parser.add_argument("--users", type=int, default=USERS)
    parser.add_argument("--looks", type=float, nargs="+", default=list(LOOKS), help="mean seconds between searches")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="for each of them")
    given = parser.parse_args()
    with kept_folder(given.folder) as folder:
        lake = Lake(folder / "lake")
        if not lake.catalog.is_file():
            large_lake(folder, recordings(), given.clips, 0, given.processes)
        shortlist(lake)
        figures = {"clips": given.clips, **measure(lake, given.users, given.looks, given.seconds)}
    for name, value in figures.items():
        print(f"{name}: {value}")
    print(record("service-load", figures))


if __name__ == "__main__":
    main()

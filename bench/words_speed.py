"""Speed of words: `python -m bench.words_speed`.

- assigning every word of hdm05 to one of 100 motifs: by DTW to medoids against embedding and L2 to centroids, on one
  thread, interleaved (Deep Motifs, section 3.3: the embedding "can save up to 80% of the time")
- words embedded a second, on one thread and by two processes of one thread each
- one `similar_clips` query in a fresh process (imports, connection, query) beside one that only imports DuckDB
"""

from __future__ import annotations

import multiprocessing
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.deep_motifs.config import PRETRAINED_WORDS, NetworkConfig
from motionlake.deep_motifs.motifs import assign, fit_motifs
from motionlake.deep_motifs.words.dtw import word_distances
from motionlake.deep_motifs.words.network import TrainedNetwork, load_network
from motionlake.deep_motifs.words.training import train_words
from motionlake.motion.features import WordConfig, word_windows
from motionlake.retrieval.sql_functions import connect
from threadpoolctl import threadpool_limits

from bench.canonical_sets import SETS, features, load
from bench.lakes import make_lake, run_all
from bench.record import hash_files, interleave, record, recordings
from bench.representation import K, medoids_of

SET: Final = "hdm05"
ROUNDS: Final = 7
CONV_STEPS: Final = 20
PAPER_SAVED: Final = 0.8
EMBED_SECONDS: Final = 5.0
COLD_QUERIES: Final = 5
PROCESSES: Final = (1, 2)
QUERY: Final = "FROM similar_clips($clip, k := 10)"
COLD: Final = f"""
import sys, time
start = time.perf_counter()
from motionlake.retrieval.sql_functions import connect
imported = time.perf_counter()
con = connect(sys.argv[1])
connected = time.perf_counter()
rows = con.execute("{QUERY}", {{"clip": sys.argv[2]}}).fetchall()
answered = time.perf_counter()
con.execute("{QUERY}", {{"clip": sys.argv[2]}}).fetchall()
again = time.perf_counter() - answered
print(len(rows), imported - start, connected - imported, answered - connected, again)
"""
ONLY_DUCKDB: Final = "import duckdb\nprint(duckdb.connect().execute('SELECT 42').fetchall())\n"


def assignment(clips: list[Float32Array]) -> dict[str, Any]:
    """Seconds of assigning all words by DTW and by each network, and the share of time saved."""
    words = np.concatenate([word_windows(clip, WordConfig()) for clip in clips])
    medoids = medoids_of(words, K, 0)
    conv = train_words(clips, WordConfig(), NetworkConfig("conv", weights="own", steps=CONV_STEPS), device="cpu")
    networks = {"linear": load_network(PRETRAINED_WORDS.file), "conv": conv}
    motifs = {name: fit_motifs(network.embed(words), len(medoids), 0) for name, network in networks.items()}

    def by_network(name: str) -> None:
        assign(networks[name].embed(words), motifs[name])

    with threadpool_limits(limits=1):
        seconds = interleave(
            {
                "dtw": lambda: np.argmin(word_distances(words, medoids), axis=1),
                "linear": lambda: by_network("linear"),
                "conv": lambda: by_network("conv"),
            },
            ROUNDS,
        )
    saved = {name: 1 - seconds[name] / seconds["dtw"] for name in networks}
    return {"words": len(words), "motifs": len(medoids), "seconds": seconds, "saved": saved, "paper": PAPER_SAVED}


def embedded_a_second(network: TrainedNetwork, words: Float32Array, seconds: float) -> float:
    """Words a second over at least so many seconds, after one pass to warm up."""
    network.embed(words)
    start, count = time.perf_counter(), 0
    while (elapsed := time.perf_counter() - start) < seconds:
        network.embed(words)
        count += len(words)
    return count / elapsed


def throughput(clips: list[Float32Array], folder: Path) -> dict[str, float]:
    """Words a second of the pretrained network by one process and by two that start at the same time."""
    words = np.ascontiguousarray(np.concatenate([word_windows(clip, WordConfig()) for clip in clips]))
    file = folder / "words.npy"
    np.save(file, words)
    rates = {}
    for processes in PROCESSES:
        context = multiprocessing.get_context("spawn")
        with context.Manager() as manager, ProcessPoolExecutor(processes, context) as pool:
            gate = manager.Barrier(processes)
            found = [pool.submit(_embed_in_process, file, gate, EMBED_SECONDS) for _ in range(processes)]
            rates[f"processes_{processes}"] = sum(future.result() for future in found)
    return rates


def _embed_in_process(file: Path, gate: Any, seconds: float) -> float:
    words, network = np.load(file), load_network(PRETRAINED_WORDS.file)
    gate.wait()
    return embedded_a_second(network, words, seconds)


def cold_query(folder: Path) -> dict[str, Any]:
    """Seconds of a fresh process with one query, its parts, and the same of one that only imports DuckDB."""
    lake = make_lake(folder, [recordings() / SETS[SET].folder])
    run_all(lake, 0, PRETRAINED_WORDS.file)
    con = connect(lake.root)
    clips = [str(row[0]) for row in con.execute("SELECT clip FROM clips ORDER BY clip").fetchall()]
    con.close()
    # Files, not `python -c`: there DuckDB takes itself to be interactive and shows progress on stdout.
    script, alone = folder / "query.py", folder / "alone.py"
    script.write_text(COLD, encoding="utf-8")
    alone.write_text(ONLY_DUCKDB, encoding="utf-8")
    parts: list[list[float]] = []

    def query() -> None:
        answer = _fresh(script, str(lake.root), clips[len(clips) // 2]).split()
        if int(answer[0]) != 10:
            raise RuntimeError(f"{answer[0]} answers instead of 10")
        parts.append([float(value) for value in answer[1:]])

    seconds = interleave({"query": query, "duckdb_alone": lambda: _fresh(alone)}, COLD_QUERIES)
    middle = [statistics.median(part) for part in zip(*parts[1:], strict=True)]
    named = dict(zip(("imports", "connection", "query", "same query again"), middle, strict=True))
    return {"clips": len(clips), "seconds": seconds, "parts": named}


def _fresh(script: Path, *arguments: str) -> str:
    command = [sys.executable, str(script), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def main() -> None:
    clips = features(load(SET), WordConfig())
    figures: dict[str, Any] = {"assignment": assignment(clips)}
    made = figures["assignment"]
    for name, saved in made["saved"].items():
        print(f"{name}: {saved:.1%} of the time of DTW saved, {made['words']} words to {made['motifs']} motifs")
    print("  the paper: up to 80 %")
    with tempfile.TemporaryDirectory(prefix="bench-words-") as folder:
        figures["embedded_a_second"] = throughput(clips, Path(folder))
        for name, rate in figures["embedded_a_second"].items():
            print(f"{name}: {rate:,.0f} words a second")
        figures["cold_query"] = cold_query(Path(folder))
    seconds, parts = figures["cold_query"]["seconds"], figures["cold_query"]["parts"]
    print(f"cold query: {seconds['query']:.2f} s, {seconds['query'] / seconds['duckdb_alone']:.1f} times DuckDB alone")
    print("  " + ", ".join(f"{name} {value:.3f} s" for name, value in parts.items()))
    paths = [path for path in (recordings() / SETS[SET].folder).rglob("*") if path.is_file()]
    print(record("words-speed", figures, hash_files(paths, recordings())))


if __name__ == "__main__":
    main()

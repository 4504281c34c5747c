"""Every bench once, on few and short recordings, to see that it works: `python -m bench.smoke [MODULE ...]`.

What it measures says nothing and is not kept. All run in this process, on a Dask cluster of threads of it; a bench
that needs recordings or peers that are not there is left out, by name. Without names all of them run.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import io
import os
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, redirect_stdout
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final
from unittest import mock

from distributed import LocalCluster
from motionlake.deep_motifs.word_segmentation import WordSegmentation
from motionlake.pesta.config import PosturesConfig

from bench.pesta.dictionaries import Spec
from bench.pesta.draws import Variant
from bench.small_sets import write_small_sets


@dataclass(frozen=True)
class First:
    """The first entries of a table of a module."""

    count: int


@dataclass(frozen=True)
class Smoke:
    """How one bench runs small.

    Attributes:
        module: to run, as in `python -m`.
        words: its command line; OUT stands for a folder that is thrown away.
        smaller: constants of modules, "module.NAME", and what they are instead (`First`: as many of their entries).
        recordings: whether it needs any.
        peers: packages that it is nothing without.
    """

    module: str
    words: tuple[str, ...] = ()
    smaller: Mapping[str, Any] = field(default_factory=dict)
    recordings: bool = True
    peers: tuple[str, ...] = ()

    def __str__(self) -> str:
        return " ".join((self.module.removeprefix("bench."), *self.words))

    def lacks(self) -> str:
        """Why it cannot run here, or ""."""
        missing = [name for name in self.peers if importlib.util.find_spec(name) is None]
        if missing:
            return f"{', '.join(missing)} not installed here (`make .venv-bench/.ready`)"
        return "" if not self.recordings or os.environ.get("MOTIONLAKE_DATA") else "MOTIONLAKE_DATA is not set"


def _parts(module: str, parts: str, *words: str, **smaller: Any) -> list[Smoke]:
    return [Smoke(module, (part, *words), smaller) for part in parts.split()]


# Benches that are small by themselves, and what runs them.
ELSEWHERE: Final = {
    "against": "tests/test_against.py",
    "check_records": "tests/test_check_records.py",
    "check_figures": "tests/test_check_figures.py",
    "golden": "tests/test_golden.py",
    "scale_methods": "tests/test_scale_methods.py",  # it takes a lake that another bench has made
    "trust_cost": "tests/test_against.py",  # another that needs a second checkout: its arithmetic alone
}
ONE_SEED: Final = (0,)
_FEW_K: Final = {"bench.lakes.K": 8, "bench.representation.K": 8}
_FEW: Final = PosturesConfig(weights="own", m=24)
_FEW_SYMBOLS: Final = dict.fromkeys(
    (
        f"bench.pesta.{module}.OWN"
        for module in ("__main__", "ablations", "dictionaries", "recipes", "threshold", "whole")
    ),
    _FEW,
)
_FEW_VARIANTS: Final = {"default": Spec(_FEW), "softness 0": Spec(replace(_FEW, softness=0.0))}
SMOKES: Final[Sequence[Smoke]] = (
    # The first two: they start the process that all commands are forked of.
    Smoke("bench.kills", ("--kills", "1", "--clips", "1"), {"bench.kills.STAGES": "words", "bench.kills.VICTIMS": (
          ("driver", signal.SIGTERM),)}, recordings=False),
    Smoke("bench.many_at_once", ("--seconds", "1", "--writers", "2", "--readers", "2", "--clips", "1"),
          {"bench.many_at_once.STAGES": "words", "bench.many_at_once.ASKED": 1}, recordings=False),
    Smoke(
        "bench.align",
        (),
        {"bench.align.ONE_STRING_CELLS": 6_400, "bench.align.LONG": 20_000, "bench.align.CLIPS": 20},
        recordings=False,
        peers=("librosa",),
    ),
    Smoke(
        "bench.strings",
        (),
        {"bench.strings.SIZES": (300,), "bench.strings.ALPHABETS": (50,), "bench.strings.LONG": 20_000},
        recordings=False,
    ),
    Smoke("bench.dtw", (), {"bench.dtw.ANCHORS": 30, "bench.dtw.WORDS": 250}, recordings=False),
    Smoke("bench.descriptor_search", ("--rounds", "3", "--sizes", "300")),
    Smoke("bench.emd", (), {"bench.emd.K": 12, "bench.emd.COUNT": 200, "bench.emd.QUERIES": 6}),
    Smoke("bench.damage", ("--flips", "1", "--losses", "1", "--each", "1")),
    Smoke("bench.fuzz", ("files", "config", "--files", "28", "--examples", "3", "--workers", "1"), recordings=False),
    Smoke("bench.humanml3d", (), {"bench.retargeting.CLIPS": 1}),
    Smoke("bench.ingest", ("peers", "--rounds", "1")),
    Smoke("bench.ingest_formats", ("--rounds", "1")),
    Smoke("bench.lake", ("ingest", "--clips", "8", "--workers", "1", "--sets", "hdm05")),
    Smoke("bench.moves", (), {"bench.moves.QUERIES": 2}),
    Smoke("bench.quality", (), {"bench.quality.LONGEST": 3.0}),
    Smoke("bench.quality_evidence", (), {"bench.quality.LONGEST": 3.0}),
    Smoke("bench.mending", (), {"bench.quality.LONGEST": 3.0}),
    Smoke("bench.generalise", ("hdm05", "--seeds", "0"), {"bench.generalise.RECIPROCALS": (24,),
          "bench.generalise.DIRECTS": (0.3,), "bench.generalise.SHARES": ((1, 1, 4, 2),)}),
    Smoke("bench.retargeting", (), {"bench.retargeting.CLIPS": 1}),
    Smoke("bench.rigs"),
    Smoke("bench.sorting", ("hdm05", "--seeds", "0"), {}),
    Smoke("bench.quality_alarms", ("OUT/alarms", "cmu_dance", "spike"), {"bench.quality_alarms.MOST": 2}),
    Smoke("bench.first_pages", ("OUT/pages",), {"bench.first_pages.DRAWN": {"cmu_exercises": 1}}),
    Smoke("bench.nights", ("--first", "6", "--nights", "2", "--clips", "2", "--seconds", "4", "--every", "1")),
    Smoke("bench.worker_scaling", ("--clips", "4", "8", "--tasks", "50"), {
          "bench.worker_scaling.STAGES": ("frames", "words"), "bench.worker_scaling.WARMING": 2}),
    Smoke("bench.whole_lake", ("OUT/whole", "--clips", "4", "--together", "2", "--workers", "1", "--again", "1"), {
          "bench.whole_lake.ALL": ("frames", "words"), "bench.whole_lake.NIGHTLY": 1}),
    Smoke("bench.window_search", ("--clips", "6", "--queries", "2", "--rounds", "1"),
          {"motionlake.stages.windows.MOST": 1}),
    Smoke("bench.stages_cost", ("--clips", "4", "8", "--workers", "1")),
    Smoke("bench.browser_scroll", (), {"bench.browser_scroll.CLIPS": 300, "bench.browser_scroll.SECONDS": 0.3,
          "bench.browser_scroll.LOADS": 1, "bench.browser_scroll.ROUNDS": 3}, recordings=False, peers=("playwright",)),
    Smoke("bench.scale_search", ("--clips", "60", "--queries", "4", "--processes", "1"), {
          "bench.scale_search.COMMANDS": 1, "bench.large_lakes.PART": 40, "motionlake.stages.graph.MOST": 20,
          "motionlake.stages.shortlist.MOST": 20, "motionlake.retrieval.lake_shortlist.MOST": 20}),
    Smoke("bench.service_load", ("--clips", "60", "--processes", "1", "--users", "2", "--looks", "0.1", "--seconds",
          "1"), {"bench.large_lakes.PART": 40}),
    Smoke("bench.retrieval", ("hdm05",), {"bench.retrieval.SEEDS": ONE_SEED, **_FEW_K}),
    Smoke("bench.retrieval", ("cross-rig",), {"bench.retrieval.SEEDS": ONE_SEED, **_FEW_K}),
    Smoke("bench.representation", ("hdm05", "--processes", "1", "--seeds", "1", "--rows",
          "raw,DTW,shallow,pretrained,conv"), {"bench.representation.K": 8, "bench.representation.COMPONENTS": 8,
          "bench.representation.CONV_STEPS": 2}),
    Smoke("bench.word_network", ("hdm05", "--seeds", "1"), {"bench.representation.K": 8, "bench.word_network.K": 8,
          "bench.representation.COMPONENTS": 8, "bench.word_network.STEPS": 2, "bench.word_network.PATIENT_STEPS": 2}),
    Smoke("bench.words_speed", (), {"bench.words_speed.ROUNDS": 1, "bench.words_speed.CONV_STEPS": 1,
          "bench.words_speed.EMBED_SECONDS": 0.1, "bench.words_speed.COLD_QUERIES": 1,
          "bench.words_speed.PROCESSES": (2,),
          "bench.words_speed.K": 8, **_FEW_K}),
    Smoke("bench.motif_weights", ("hdm05", "--seeds", "1"), {"bench.motif_weights.K": 8}),
    Smoke("bench.motion_graph", (), {"bench.motion_graph.SEEDS": ONE_SEED, "bench.motion_graph.WALKS": range(2),
          "bench.motion_graph.SECONDS": 5.0, **_FEW_K}),
    Smoke("bench.neighbours", ("--words", "1500"), {"bench.neighbours.ANCHORS": 20}),
    Smoke("bench.query_by_example", ("--words", "5", "--queries", "3"), {"bench.query_by_example.SEEDS": ONE_SEED}),
    Smoke("bench.duplicates", (), {"bench.duplicates.COPIED": 5, **_FEW_K}),
    Smoke("bench.segmentation", ("0",),
          {"bench.segmentation.VARIANTS": {"default": (WordSegmentation(), True)}, **_FEW_K}),
    Smoke("bench.comparators", ("retrieval", "--seeds", "1", "--sets", "hdm05"), {"bench.representation.K": 8,
          "bench.comparators.manifold.STEPS": 2}),
    Smoke("bench.comparators", ("segmentation", "--seeds", "1"), {"bench.comparators.segmentation.MOST": (24,),
          "bench.comparators.segmentation.SHARES": (0.1,), **_FEW_K}),
    Smoke("bench.signatures", ("--k", "8", "hdm05"), {"bench.signatures.SEEDS": ONE_SEED}),
    Smoke("bench.joint_twist", (), {"bench.representation.K": 8, "bench.representation.COMPONENTS": 8}),
    Smoke("bench.pretrained_words", ("--out", "OUT/words.safetensors")),
    Smoke("bench.pretrained_postures", ("--out", "OUT/postures.safetensors"),
          {"bench.pretrained_postures.POSTURES": 900}),
    Smoke("bench.pretrained_descriptors", ("descriptors", "--rounds", "1", "--out", "OUT/descriptors.safetensors")),
    Smoke("bench.pretrained_descriptors", ("submotion", "--rounds", "1", "--out", "OUT/submotion.safetensors")),
    Smoke("bench.pretrained_generator", ("--epochs", "1", "--out", "OUT/generator.safetensors"),
          {"bench.pretrained_generator.EXAMPLES": 50}),
    Smoke("bench.text_search", ("queries", "speed", "labels"), {"bench.text_search.CLIPS": 300,
          "bench.text_search.SEEDS": ONE_SEED, "bench.text_search.LABELLED": ("hdm05",)}),
    Smoke("bench.synthesis_speed", ("--counts", "1", "--workers", "1", "--epochs", "1"),
          {"bench.synthesis_speed.TOGETHER": 2, "bench.synthesis_speed.UNITS": 32,
          "bench.synthesis_speed.SECONDS": 2.0}),
    Smoke("bench.matching", (), {"bench.matching.CHANGES": 3, "bench.matching.EIGHTS": 1,
          "bench.matching.EIGHT_SECONDS": 5.0}),
    Smoke("bench.made", ("table", "--splits", "indian", "--seeds", "1", "--epochs", "1", "--folds", "0"), {
          "bench.made.generators.SECONDS": 2.0, "bench.made.splits.FOLDS": 2}),
    Smoke("bench.made", ("errors", "--splits", "indian", "--epochs", "1", "--folds", "0", "--methods", "zero_velocity",
          "matching", "networks", "onset", "onset, network alone", "seq2seq, all channels", "seq2seq, as the onset"),
          {"bench.made.splits.FOLDS": 2}),
    Smoke("bench.made", ("blind", "OUT/blind", "--pairs", "2"), {"bench.made.blind.CLASSES": {"indian": None},
          "bench.made.blind.LONGEST": 1.0, "bench.made.splits.FOLDS": 2}),
    Smoke("bench.style", (), {"bench.style.SEEDS": ONE_SEED, "bench.style.STYLES": 1, "bench.style.SECONDS": 3.0}),
    Smoke("bench.keyframes", ("run",), {"bench.keyframes.GAPS": (0.5,), "bench.keyframes.CLIPS": 1}),
    *_parts("bench.pesta", "whole ranges sub_queries robustness elasticity ablations recipes threshold gaps draws",
            "--seeds", "1", "--processes", "1", "--hidden", "8", **_FEW_SYMBOLS, **{
            "bench.pesta.elasticity.SIZES": (8, 24), "bench.pesta.elasticity.ROUNDS": 1,
            "bench.pesta.ablations.variants": lambda recipe: _FEW_VARIANTS, "bench.pesta.recipes.SIZES": (24,),
            "bench.pesta.recipes.SETS": ("hdm05", "salsa"), "bench.pesta.threshold.SETS": ("hdm05",),
            "bench.pesta.threshold.COUNTS": (500,), "bench.pesta.gaps.SETS": ("hdm05",),
            "bench.pesta.draws.SETS": ("cmu_exercises", "salsa"),
            "bench.pesta.draws.VARIANTS": {"default": Variant(_FEW)}}),
    Smoke("bench.mutation", ("emd", "--sample", "1"), recordings=False, peers=("cosmic_ray",)),
    Smoke("bench.pesta.cut_files", ("cmu_bvh", "--windows", "2")),
    *_parts("bench.deephums", "retrieval choices unlabelled submotion performances", "--seeds", "1", "--epochs", "1",
            "--steps", "1", **{"bench.deephums.choices.CHOICES": First(6), "bench.deephums.unlabelled.DRAWS": 1,
            "bench.deephums.unlabelled.SKETCHES": ()}),
    Smoke("bench.deephums", ("curves", "--seeds", "1", "--epochs", "10")),
    *_parts("bench.glogen", "sparse", "--seeds", "1", "--epochs", "1", "--methods", "zero_velocity", "seq2seq",
            "motionlake"),
    *_parts("bench.glogen", "whole", "--seeds", "1", "--epochs", "1", "--methods", "zero_velocity", "motionlake"),
    *_parts("bench.glogen", "dense", "--seeds", "1", "--epochs", "1", "--sets", "indian", "--methods",
            "zero_velocity", "seq2seq", "motionlake"),
    *_parts("bench.glogen", "search", "--seeds", "1", "--epochs", "1", "--sets", "utd_mhad", "--methods", "seq2seq"),
    *_parts("bench.glogen", "measures", "--seeds", "1", "--epochs", "1", "--sets", "indian",
            **{"bench.glogen.measured.COUNT": 1, "bench.glogen.measured.EVERY": 2}),
    *_parts("bench.glogen", "long between", "--seeds", "1", "--epochs", "1", "--sets", "indian"),
)  # fmt: skip


def run(smoke: Smoke, out: Path) -> None:
    """Run a bench as its command line does."""
    module = importlib.import_module(smoke.module)
    if hasattr(module, "__path__"):
        module = importlib.import_module(f"{smoke.module}.__main__")
    words = [word.replace("OUT", str(out)) for word in smoke.words]
    with ExitStack() as stack:
        stack.enter_context(mock.patch.object(sys, "argv", [smoke.module, *words]))
        for name, value in smoke.smaller.items():
            where, _, constant = name.rpartition(".")
            owner = importlib.import_module(where)
            less = dict(list(getattr(owner, constant).items())[: value.count]) if isinstance(value, First) else value
            stack.enter_context(mock.patch.object(owner, constant, less))
        module.main()


def _spent() -> tuple[float, float]:
    """Seconds by the clock, and of processors, those of finished children among them."""
    return time.perf_counter(), sum(os.times()[:4])


@contextmanager
def prepared() -> Iterator[Path]:
    """A folder for what benches write, small sets in the place of the recordings, and clusters of threads."""
    with tempfile.TemporaryDirectory(prefix="bench-smoke-") as name, ExitStack() as stack:
        folder = Path(name)
        if data := os.environ.get("MOTIONLAKE_DATA"):
            write_small_sets(Path(data), folder / "data")
            stack.enter_context(mock.patch.dict(os.environ, MOTIONLAKE_DATA=str(folder / "data")))
        stack.enter_context(mock.patch("bench.record.RESULTS", folder / "results"))
        threads = partial(LocalCluster, processes=False)
        stack.enter_context(mock.patch("motionlake.jobs.cluster.LocalCluster", threads))
        yield folder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="*", metavar="MODULE", help="these alone, such as emd or pesta")
    parser.add_argument("--processes", type=int, default=1, help="that share the modules out")
    parser.add_argument("--taken", type=Path, help="folder in which processes enter the modules that they take")
    given = parser.parse_args()
    modules = list(dict.fromkeys(smoke.module for smoke in SMOKES))
    wanted = [f"bench.{name.removeprefix('bench.')}" for name in given.modules] or modules
    if unknown := sorted(set(wanted) - set(modules)):
        parser.error(f"{', '.join(unknown)}: no such bench")
    if given.processes > 1:
        with tempfile.TemporaryDirectory(prefix="bench-smoke-taken-") as taken:
            command = [sys.executable, "-m", "bench.smoke", "--taken", taken, *wanted]
            started = [subprocess.Popen(command) for _ in range(given.processes)]
            sys.exit(max(process.wait() for process in started))
    sys.exit(1 if run_all([smoke for smoke in SMOKES if smoke.module in wanted], given.taken) else 0)


def takes(module: str, taken: Path | None) -> bool:
    """Whether this process is the first of those that share a folder to take a module."""
    if taken is None:
        return True
    try:
        (taken / module).touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def run_all(chosen: Sequence[Smoke], taken: Path | None = None) -> int:
    """Run benches one after the other and say of each how it went; how many failed.

    Those of modules that another process has entered in the folder `taken` are left to it.
    """
    outcomes: Counter[str] = Counter()
    with prepared() as folder:
        for module in dict.fromkeys(smoke.module for smoke in chosen):
            if takes(module, taken):
                outcomes.update(run_one(smoke, folder) for smoke in chosen if smoke.module == module)
    print(f"benches: {outcomes['ran']} ran, {outcomes['left out']} left out, {outcomes['FAILED']} failed")
    return outcomes["FAILED"]


def run_one(smoke: Smoke, folder: Path) -> str:
    """Run a bench and say how it went: "ran", "left out" or "FAILED"."""
    if reason := smoke.lacks():
        print(f"left out  {smoke}: {reason}", flush=True)
        return "left out"
    before, said = _spent(), io.StringIO()
    try:
        with redirect_stdout(said):
            run(smoke, folder)
    except (Exception, SystemExit):  # a bench may leave with a message
        print(f"FAILED    {smoke}\n{said.getvalue()}{traceback.format_exc()}", flush=True)
        return "FAILED"
    clock, processor = (after - then for after, then in zip(_spent(), before, strict=True))
    print(f"{clock:7.1f} s, of processors {processor:5.1f}: {smoke}", flush=True)
    return "ran"


if __name__ == "__main__":
    main()

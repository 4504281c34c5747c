"""Synthesis measured on a labelled lake (section 4.3 of the thesis)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

from motionlake.arrays import StepProgress
from motionlake.deephums.sequence import clip_sequence
from motionlake.errors import UserError
from motionlake.evaluation.clips import Notice
from motionlake.evaluation.synthesis_clips import RealMotion, real_clips
from motionlake.evaluation.synthesis_generator import DEFAULT, Plan, SynthesisEvaluation, measure_generator
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, current_model
from motionlake.stages.descriptors import served_network
from motionlake.stages.synthesis import open_generator

KIND: Final = "synthesis"
UNITS: Final = {
    "mean_per_joint_error": "mm", "euclidean": "mm", "errors_ms": "mm", "euclidean_ms": "mm",
    "sparse": "body lengths (leg plus torso) of the standard skeleton", "foot_sliding": "m/s",
    "contact": "share of frames", "bone_length_drift": "%", "energy": "m²/s²", "travel_speed": "m/s",
    "recognised": "share", "nearest_real": "body lengths, Euclidean over 14 joints", "fid": "descriptors of length one",
}  # fmt: skip


def evaluate_synthesis(
    con: Connection, lake: Lake, plan: Plan = DEFAULT, *, dataset: str | None = None, split: str | None = None,
    repository: str | None = None, column: str = "label", notice: Notice = lambda line: None,
    progress: StepProgress = lambda what, done, total: None,
) -> SynthesisEvaluation:  # fmt: skip
    """Measure the lake's generator on test clips, by the descriptor network that the lake serves.

    Args:
        con: to the lake.
        lake: for models and frames.
        plan: what is made.
        dataset: its clips only.
        split, repository: values of the column split, of the clips to go on from and compare with, and of those that
            classes are learned from and that might be copied; "test" and "train" where they are not given. Where no
            clip is of these and none is asked for, every clip is both, and nothing is compared with its own clip.
        column: what says the class of clips.
        notice: hears what is to be doubted.
        progress: hears what is done, and how much of it.

    Returns:
        What `measure_generator` tells; protocol, model and descriptor (name, what each was trained on), units; warning:
        None unless the generator was trained on clips that it is measured by.

    Raises:
        UserError: no generator, no descriptors, no such split or column, or no clip to measure by.
    """
    from motionlake.deephums.trained import load_descriptor
    from motionlake.glogen.generator import TrainingMotion, embed_motions

    model = current_model(con, KIND)
    if model is None:
        raise UserError(f"{lake.root}: has no generator yet; train one with `motionlake train synthesis --split train`")
    network = served_network(con)
    if network is None:
        raise UserError(f"{lake.root}: has no descriptors yet; make them with `motionlake run descriptors`")
    generator = open_generator(lake, model)
    descriptor = load_descriptor(lake.path(network.file))
    clips = real_clips(
        con, lake, generator.classes, dataset=dataset, split=split, repository=repository, column=column
    )  # fmt: skip
    notice(f"{clips.protocol}: {len(clips.test)} clips to go on from, {len(clips.training)} known")
    measured = measure_generator(
        generator, clips.test, clips.training, lambda motions: descriptor.embed([clip_sequence(*m) for m in motions]),
        plan, progress,
    )  # fmt: skip
    warning = _warning(model, clips.test, clips.split)
    if warning:
        notice(f"warning: {warning}")
    measured.found["n"]["other_classes_left_out"] = clips.strangers
    measured.found.update(
        protocol=clips.protocol, units=UNITS, model=_told(model), descriptor=_told(network), warning=warning
    )
    read = [TrainingMotion(clip.positions, clip.fps, clip.label) for clip in clips.test]
    return replace(measured, embedded=embed_motions(generator, read))


def _told(model: Model) -> dict[str, Any]:
    return {"model": model.model, **{name: value for name, value in model.figures.items() if name != "loss"}}


def _warning(model: Model, test: Sequence[RealMotion], split: str | None) -> str | None:
    """Which test clips the generator has been trained on, as far as its figures tell."""
    trained, dataset = model.figures.get("split"), model.figures.get("dataset")
    if trained is not None and trained != split:
        return None
    seen = [clip for clip in test if dataset in (None, clip.dataset)]
    if not seen:
        return None
    where = (f"split {trained}" if trained else "every clip") + (f" of {dataset}" if dataset else "")
    counts = Counter(clip.dataset for clip in seen)
    return (
        f"{len(seen)} of {len(test)} clips to measure by are such that {model.model} was trained on ({where}: "
        f"{', '.join(f'{n} of {name}' for name, n in sorted(counts.items()))}): the measures flatter; "
        "`motionlake train synthesis --split train` keeps them apart"
    )

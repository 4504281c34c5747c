"""What a run will train before it can go on, and what each stage still lacks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motionlake.stages.model_kind import ModelKind
from motionlake.stages.reader import LakeReader
from motionlake.stages.registry import EVERY, STAGES


def dry_run(at: LakeReader, stages: Sequence[str], *, refit: bool) -> list[str]:
    """A line for each model that a run of these stages needs: whether it will be trained."""
    found = [(name, STAGES[name].model) for name in stages]
    return [f"{name}: {_outlook(at, model, refit=refit)}" for name, model in found if model is not None]


def _outlook(at: LakeReader, kind: ModelKind[Any], *, refit: bool) -> str:
    model = kind.fitting(at)
    if model is not None and not refit:
        return f"will not train; {model.model} {kind.use}"
    if not refit and kind.takes_pretrained(at):
        return f"will not train; the pretrained {kind.title} {kind.use}"
    return kind.announce(at)


def pending(at: LakeReader) -> dict[str, int]:
    """How many parts each stage still lacks; where one compares pairs of parts, how many shards."""
    return {stage.name: stage.due(at) for stage in EVERY}

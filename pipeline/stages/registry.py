"""Every stage, in the order in which they hang on one another: one line a stage.

From here follow `run all` and `run NAME`, the dry run before a run, `status`, the folders that are searched for parts
which nothing names, the targets of the Makefile and the table in docs/architecture.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from motionlake.stages.clip_map import CLIP_MAP
from motionlake.stages.descriptors import DESCRIPTORS
from motionlake.stages.embed import EMBED
from motionlake.stages.frames import FRAMES
from motionlake.stages.graph import GRAPH
from motionlake.stages.mirrored import MIRRORED
from motionlake.stages.model_kind import ModelKind
from motionlake.stages.moves import MOVES
from motionlake.stages.neighbours import NEIGHBOURS
from motionlake.stages.postures import POSTURES
from motionlake.stages.quality import QUALITY
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist import SHORTLIST
from motionlake.stages.signatures import MOTIFS, SIGNATURES
from motionlake.stages.stage import Stage
from motionlake.stages.submotions import SUBMOTIONS
from motionlake.stages.symbols import SYMBOLS
from motionlake.stages.synthesis import SYNTH
from motionlake.stages.synthesize import SYNTHESIZE
from motionlake.stages.transitions import TRANSITIONS
from motionlake.stages.windows import WINDOWS
from motionlake.stages.words import WORDS

EVERY: Final[tuple[Stage, ...]] = (
    FRAMES,
    WORDS,
    EMBED,
    MOTIFS,
    SIGNATURES,
    MIRRORED,
    POSTURES,
    SYMBOLS,
    MOVES,
    DESCRIPTORS,
    SUBMOTIONS,
    WINDOWS,
    GRAPH,
    SHORTLIST,
    NEIGHBOURS,
    TRANSITIONS,
    SYNTH,
    QUALITY,
    CLIP_MAP,
)
ON_REQUEST: Final[Stage] = SYNTHESIZE  # planned for what `motionlake synthesize` is asked for, never due

STAGES: Final = {stage.name: stage for stage in EVERY}
ALL: Final = tuple(stage.name for stage in EVERY if not stage.by_name)
BY_NAME: Final = tuple(stage.name for stage in EVERY if stage.by_name)
KINDS: Final[dict[str, ModelKind[Any]]] = {s.model.name: s.model for s in EVERY if s.model is not None}
FOLDERS: Final = tuple(sorted({"staging", "models", *(f for s in (*EVERY, ON_REQUEST) for f in s.folders)}))


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

"""Job "synth": get a generator of motion if the lake has none that fits."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from motionlake.arrays import Progress
from motionlake.glogen.config import PRETRAINED_GENERATOR
from motionlake.jobs import modelling
from motionlake.jobs.execute import Outcome
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading
from motionlake.lake.models import Model
from motionlake.stages import synthesis

GENERATOR = modelling.Network(
    kind=synthesis.GENERATOR,
    stage=synthesis.NAME,
    title="generator",
    command="synthesis",
    key=synthesis.generator_key,
    settings=lambda config: asdict(config.synthesis),
    takes_ready_made=synthesis.takes_ready_made,
    ready_made=lambda: PRETRAINED_GENERATOR.file,
    take_weights=synthesis.take_weights,
)


def run(session: Session, *, refit: bool = False) -> Outcome:
    """Get a generator where none fits the configuration; `refit` trains one in any case."""
    modelling.obtain(session, GENERATOR, train, refit=refit)
    return Outcome()


def train(session: Session, split: str | None = None, dataset: str | None = None) -> Model | None:
    """Train a generator on clips of known class, those of a split or of a dataset, and make it current.

    Returns:
        None in a lake without clips.

    Raises:
        UserError: there are no such clips, none of them has a label, or they are too few.
    """
    from motionlake.stages import synthesis_training

    lake, config = session.lake, session.config.synthesis
    with reading(lake) as con:
        material = synthesis_training.motion_set(con, lake, config, split, dataset)
    if material is None:
        session.notice("synth: there are no frames yet; `motionlake ingest` takes clips in")
        return None

    def fit(file: str, progress: Progress) -> dict[str, Any]:
        return synthesis_training.train(lake, material, config, file, progress)

    return modelling.train(session, GENERATOR, fit)

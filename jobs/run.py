"""Run one stage or all of them, in the order in which they hang on one another."""

from __future__ import annotations

from motionlake.jobs import (
    descriptors,
    embed,
    frames,
    mirrored,
    motifs,
    neighbours,
    postures,
    signatures,
    submotions,
    symbols,
    synth,
    transitions,
    words,
)
from motionlake.jobs.execute import Outcome
from motionlake.jobs.frames import IngestReport
from motionlake.jobs.session import Session

STAGES = (
    "frames", "words", "embed", "motifs", "signatures", "mirrored", "postures", "symbols", "descriptors", "submotions",
)  # fmt: skip
# Made when asked for by name: two compare all clips with one another, "synth" may train for minutes.
BY_NAME = ("neighbours", "transitions", "synth")


def run(
    session: Session,
    stages: tuple[str, ...],
    *,
    refit: bool = False,
    retry_failed: bool = False,
    dataset: str | None = None,
) -> IngestReport | None:
    """Bring stages up to date; `refit` fits the models of those stages anew, `dataset` is for transitions."""
    report = None
    for stage in stages:
        if stage == "frames":
            report = frames.run(session, retry_failed=retry_failed)
        elif stage == "transitions":
            session.outcomes[stage] = transitions.run(session, dataset)
        else:
            session.outcomes[stage] = _derived(session, stage, refit)
    return report


def _derived(session: Session, stage: str, refit: bool) -> Outcome:
    if stage == "words":
        return words.run(session)
    if stage == "embed":
        return embed.run(session, refit=refit)
    if stage == "motifs":
        return motifs.run(session, refit=refit)
    if stage == "neighbours":
        return neighbours.run(session, refit=refit)
    if stage == "mirrored":
        return mirrored.run(session)
    if stage == "postures":
        return postures.run(session, refit=refit)
    if stage == "symbols":
        return symbols.run(session)
    if stage == "descriptors":
        return descriptors.run(session, refit=refit)
    if stage == "submotions":
        return submotions.run(session, refit=refit)
    if stage == "synth":
        return synth.run(session, refit=refit)
    return signatures.run(session)

"""Run one stage or all of them, in the order in which they hang on one another."""

from __future__ import annotations

from jobs import embed, frames, motifs, signatures, words
from jobs.execute import Outcome
from jobs.frames import IngestReport
from jobs.session import Session

STAGES = ("frames", "words", "embed", "motifs", "signatures")


def run(
    session: Session, stages: tuple[str, ...], *, refit: bool = False, retry_failed: bool = False
) -> IngestReport | None:
    """Bring stages up to date; `refit` fits the models of those stages anew."""
    report = None
    for stage in stages:
        if stage == "frames":
            report = frames.run(session, retry_failed=retry_failed)
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
    return signatures.run(session)

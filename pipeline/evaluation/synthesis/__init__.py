"""A generator measured: errors, movement, likeness, variety, copies, beside real motion (chapter 4 of the thesis)."""

from __future__ import annotations

from motionlake.evaluation.synthesis.protocol import (
    DEFAULT,
    UNITS,
    SynthesisEvaluation,
    SynthesisPlan,
    evaluate_synthesis,
    measure_generator,
)

__all__ = ["DEFAULT", "UNITS", "SynthesisEvaluation", "SynthesisPlan", "evaluate_synthesis", "measure_generator"]

"""Training a generator: GloGen, then LocGen, on clips of known class."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pipeline.clip import FloatArray
from pipeline.glogen.recipe import SEEDS, GloGenRecipe, glogen_recipe
from pipeline.glogen.training import epochs_of, train_glogen
from pipeline.locgen.lead_in import fit_lead_in
from pipeline.locgen.recipe import LocGenRecipe, locgen_recipe
from pipeline.locgen.training import train_locgen
from pipeline.synthesis.config import SynthesisConfig
from pipeline.synthesis.generator import TrainedGenerator
from pipeline.trajectories.motion import BodyMotion, body_motion
from pipeline.trajectories.pieces import Piece, goes_on, pieces
from pipeline.trajectories.sparse import PIECE

Progress = Callable[[int, int, float], None]
STRIDE: Final = 25  # frames from piece to piece of a long clip, by the default recipe
MOST: Final = 2000  # pieces that overlap, about


@dataclass(frozen=True)
class TrainingMotion:
    """A clip to train on: [F, 21, 3] canonical joints in metres, y up, its rate, its class."""

    positions: FloatArray
    fps: float
    label: str


def train_generator(
    motions: Sequence[TrainingMotion],
    config: SynthesisConfig,
    *,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> TrainedGenerator:
    """Train a generator.

    Args:
        motions: clips of known class.
        config: recipe, seed, epochs (of either network).
        checkpoint: a file to save training to and to go on from; deleted at the end.
        progress: called with (epochs done, epochs, mean loss) after each epoch of either network.

    Returns:
        The generator; the same for the same input, configuration and seed, interrupted or not. Its figures: `clips`,
        `classes`, `loss` of each epoch of GloGen, `locgen_loss`.

    Raises:
        ValueError: no clips, or one that cannot be read.
    """
    if not motions:
        raise ValueError("there are no clips to train on")
    read = [body_motion(motion.positions, motion.fps) for motion in motions]
    return fit_generator(read, [motion.label for motion in motions], config, checkpoint=checkpoint, progress=progress)


def fit_generator(
    motions: Sequence[BodyMotion],
    labels: Sequence[str],
    config: SynthesisConfig,
    *,
    glogen: GloGenRecipe | None = None,
    locgen: LocGenRecipe | None = None,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> TrainedGenerator:
    """`train_generator` of motions that are read already, by recipes other than the configuration's if given."""
    first = glogen or glogen_recipe(config.recipe, config.epochs)
    second = locgen or locgen_recipe(config.recipe, config.epochs)
    classes = sorted(set(labels))
    targets = [classes.index(label) for label in labels]
    ahead = first.architecture == "ahead"
    going = goes_on(motions, targets, len(classes)) if ahead else [False] * len(classes)
    stride = STRIDE if ahead else PIECE
    again = _again(motions, [going[target] for target in targets], first.again)

    def cut(again: int) -> list[Piece]:
        made = pieces(
            motions, targets, count=first.sparse, stride=stride, mirror=first.mirror, going=going, again=again
        )  # fmt: skip
        return [piece for piece in made if len(piece.sparse.rows) > SEEDS]

    whole = cut(0)
    made = cut(again) if again else whole
    if not whole:
        raise ValueError("all clips are too short to train on")
    share = _frames(whole, going) / max(1, _frames(made, going)) if again else 1.0
    lengths, of = [len(piece.sparse.rows) for piece in made], [piece.target for piece in made]
    before = epochs_of(lengths, of, going, first, share)
    epochs = before + second.epochs_of(len(whole))

    def beside(name: str) -> Path | None:
        return checkpoint.with_name(f"{checkpoint.stem}-{name}{checkpoint.suffix}") if checkpoint else None

    def tell(already: int) -> Progress | None:
        return None if progress is None else lambda done, _, loss: progress(already + done, epochs, loss)

    glogen_network, losses = train_glogen(
        [piece.sparse.rows.astype(np.float32) for piece in made],
        np.array(of),
        len(classes),
        first,
        config.seed,
        going=going,
        share=share,
        checkpoint=beside("glogen"),
        progress=tell(0),
    )
    locgen_network, dense_losses = train_locgen(
        whole, second, config.seed, checkpoint=beside("locgen"), progress=tell(before)
    )
    lead = fit_lead_in(motions, targets, going)
    figures = {
        "clips": len(motions), "classes": len(classes), "loss": [round(loss, 5) for loss in losses],
        "locgen_loss": [round(loss, 5) for loss in dense_losses],
    }  # fmt: skip
    return TrainedGenerator(config, classes, going, glogen_network, locgen_network, lead, figures)


def _again(motions: Sequence[BodyMotion], going: Sequence[bool], least: int) -> int:
    """Frames from piece to piece of clips that go on: more where there are so many that pieces need not overlap."""
    frames = sum(len(motion) for motion, on in zip(motions, going, strict=True) if on)
    return min(max(least, -(-frames // MOST)), PIECE) if least and frames else 0


def _frames(made: Sequence[Piece], going: Sequence[bool]) -> int:
    """How many frames pieces of classes that go on hold."""
    return sum(len(piece.motion) for piece in made if going[piece.target])

"""Training a generator: GloGen, then LocGen, on clips of known class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.glogen.config import (
    SEEDS,
    GloGenRecipe,
    LocGenRecipe,
    OnsetRecipe,
    SynthesisConfig,
    glogen_recipe,
    locgen_recipe,
    onset_recipe,
)
from motionlake.glogen.generator import TrainedGenerator, TrainingMotion
from motionlake.glogen.inbetweening import train_locgen
from motionlake.glogen.onset import MOST as EXAMPLES
from motionlake.glogen.onset import fit_onset
from motionlake.glogen.sparse import PIECE, TrainingPiece, cyclic_classes, pieces, reach
from motionlake.glogen.training import ByClass, epochs_of, groups, train_glogen
from motionlake.glogen.trajectories import BodyMotion, body_motion
from motionlake.motion.calibration import recorded
from motionlake.motion.sides import names_a_side

STRIDE: Final = 25  # frames from piece to piece of a long clip, by the default recipe
MOST: Final = 2000  # pieces that overlap, about


def train_generator(
    motions: Sequence[TrainingMotion],
    config: SynthesisConfig,
    *,
    examples: int = EXAMPLES,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> TrainedGenerator:
    """Train a generator.

    Args:
        motions: clips of known class; calibration poses at their ends are left out.
        config: recipe, seed, epochs (of each network).
        examples: that the kernels of the onset keep, at most.
        checkpoint: a file to save training to and to go on from; deleted at the end.
        progress: called with (epochs done, epochs, mean loss) after each epoch of each network.

    Returns:
        The generator; the same for the same input, configuration and seed, interrupted or not. Its metrics: `clips`,
        `classes`, `loss` of each epoch of GloGen, `locgen_loss`, `onset_loss`.

    Raises:
        ValueError: no clips, or one that cannot be read.
    """
    if not motions:
        raise ValueError("there are no clips to train on")
    read = [body_motion(recorded(motion.positions, motion.fps), motion.fps) for motion in motions]
    labels = [motion.label for motion in motions]
    return fit_generator(read, labels, config, examples=examples, checkpoint=checkpoint, progress=progress)


def fit_generator(
    motions: Sequence[BodyMotion],
    labels: Sequence[str],
    config: SynthesisConfig,
    *,
    glogen: GloGenRecipe | None = None,
    locgen: LocGenRecipe | None = None,
    onset: OnsetRecipe | None = None,
    examples: int = EXAMPLES,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> TrainedGenerator:
    """`train_generator` of motions that are read already, by recipes other than the configuration's if given."""
    first = glogen or glogen_recipe(config.recipe, config.epochs)
    second, third = locgen or locgen_recipe(config.recipe, config.epochs), onset or onset_recipe(config.epochs)
    classes = sorted(set(labels))
    targets = [classes.index(label) for label in labels]
    cyclic = cyclic_classes(motions, targets, len(classes)) if first.architecture == "ahead" else [False] * len(classes)
    whole = _cut(motions, targets, cyclic, first)
    if not whole:
        raise ValueError("all clips are too short to train on")
    known = {piece.target for piece in whole}
    parts = [
        _Part.of(motions, targets, cyclic, own, first)
        for own in groups(cyclic, [target in known for target in range(len(classes))])
    ]
    # The thesis has no onset.
    led = [motion for motion in motions if first.architecture == "ahead"]
    epochs = sum(part.epochs(first) for part in parts) + second.epochs_of(len(whole))
    epochs += third.epochs_of(len(known)) if led else 0
    done_before = 0

    def beside(name: str) -> Path | None:
        return checkpoint.with_name(f"{checkpoint.stem}-{name}{checkpoint.suffix}") if checkpoint else None

    def tell() -> Progress | None:
        before = done_before
        return None if progress is None else lambda done, _, loss: progress(before + done, epochs, loss)

    networks, losses = [], []
    for i, part in enumerate(parts):
        network, found = train_glogen(
            part.rows, part.targets, len(part.classes), first, config.seed, cyclic=part.cyclic, share=part.share,
            checkpoint=beside(f"glogen-{i}"), stays=True, progress=tell(),
        )  # fmt: skip
        networks.append(network)
        losses += found
        done_before += part.epochs(first)
    locgen_network, dense_losses = train_locgen(
        whole, second, config.seed, checkpoint=beside("locgen"), stays=True, progress=tell()
    )
    done_before += second.epochs_of(len(whole))
    begins, onset_losses = fit_onset(
        led, targets[: len(led)], cyclic, mirroring=[not names_a_side(name) for name in classes], examples=examples,
        recipe=third, seed=config.seed, checkpoint=beside("onset"), progress=tell(),
    )  # fmt: skip
    for file in (*(beside(f"glogen-{i}") for i in range(len(parts))), beside("locgen"), beside("onset")):
        if file is not None:
            file.unlink(missing_ok=True)
    metrics = {
        "clips": len(motions), "classes": len(classes), "loss": [round(loss, 5) for loss in losses],
        "locgen_loss": [round(loss, 5) for loss in dense_losses],
        "onset_loss": [round(loss, 5) for loss in onset_losses],
    }  # fmt: skip
    return TrainedGenerator(
        config, classes, cyclic, reach(motions, targets, cyclic, SEEDS, first.sparse),
        ByClass(first, networks, [part.classes for part in parts]), locgen_network, begins, metrics,
    )  # fmt: skip


@dataclass(frozen=True)
class _Part:
    """What one network of GloGen is trained on.

    Attributes:
        classes: that it knows.
        rows: sparse poses of each piece.
        targets: class of each, one of its own.
        cyclic: whether each of its classes is cyclic.
        share: of the pieces of these that an epoch takes, which overlap.
    """

    classes: list[int]
    rows: list[Float32Array]
    targets: Int64Array
    cyclic: list[bool]
    share: float

    @classmethod
    def of(
        cls,
        motions: Sequence[BodyMotion],
        targets: Sequence[int],
        cyclic: Sequence[bool],
        classes: list[int],
        recipe: GloGenRecipe,
    ) -> _Part:
        some = [motion for motion, target in zip(motions, targets, strict=True) if target in classes]
        own = [classes.index(target) for target in targets if target in classes]
        on = [cyclic[target] for target in classes]
        frames = sum(len(motion) for motion, target in zip(some, own, strict=True) if on[target])
        # Where there are many clips of cyclic classes, their pieces need not overlap as much.
        again = min(max(recipe.again, -(-frames // MOST)), PIECE) if recipe.again and frames else 0
        whole, made = (_cut(some, own, on, recipe, each) for each in (0, again))
        share = _frames(whole, on) / max(1, _frames(made, on)) if again else 1.0
        rows = [piece.sparse.rows.astype(np.float32) for piece in made]
        return cls(classes, rows, np.array([piece.target for piece in made], dtype=np.int64), on, share)

    def epochs(self, recipe: GloGenRecipe) -> int:
        """How many its network is trained for."""
        return epochs_of([len(rows) for rows in self.rows], self.targets.tolist(), self.cyclic, recipe, self.share)


def _cut(
    motions: Sequence[BodyMotion], targets: Sequence[int], cyclic: Sequence[bool], recipe: GloGenRecipe, again: int = 0
) -> list[TrainingPiece]:
    """Pieces with more sparse poses than are given."""
    stride = STRIDE if recipe.architecture == "ahead" else PIECE
    made = pieces(
        motions, targets, count=recipe.sparse, stride=stride, mirror=recipe.mirror, cyclic=cyclic, again=again
    )
    return [piece for piece in made if len(piece.sparse.rows) > SEEDS]


def _frames(made: Sequence[TrainingPiece], cyclic: Sequence[bool]) -> int:
    """How many frames pieces of classes that go on hold."""
    return sum(len(piece.motion) for piece in made if cyclic[piece.target])

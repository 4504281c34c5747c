"""How LocGen is built and trained, by name."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

Architecture = Literal["frames", "between"]


@dataclass(frozen=True)
class LocGenRecipe:
    """Sizes and training of LocGen.

    Attributes:
        architecture: "frames": reads a whole interpolated motion at 30 frames a second; "between": the thesis's, reads
            the poses between two sparse poses alone.
        between: M of equation 4.3, poses from one sparse pose to the next; "frames" takes as many as the time holds.
        embedding, state: widths of what is made of a pose, and of the recurrent layers, both directions together.
        noise: of the sparse poses while training, body lengths.
        smooth: weight of the error of differences from frame to frame.
        epochs, steps: of training: so many epochs, more where these have fewer steps than `steps`.
    """

    architecture: Architecture = "frames"
    between: int = 0
    embedding: int = 128
    state: int = 192
    noise: float = 0.004
    smooth: float = 4.0
    dropout: float = 0.1
    optimiser: Literal["adam", "sgd"] = "adam"
    learning_rate: float = 2e-3
    weight_decay: float = 0.01
    batch: int = 16
    epochs: int = 20
    steps: int = 200

    def batches(self, count: int) -> int:
        """How many batches `count` pieces make."""
        return max(1, round(count / self.batch))

    def epochs_of(self, count: int) -> int:
        """How many epochs are trained on `count` pieces."""
        return max(self.epochs, -(-self.steps // self.batches(count)))


_RECIPES: Final = {
    "default": LocGenRecipe(),
    # Sections 4.2 and 4.3: as GloGen without classes, M = 5.
    "glogen": LocGenRecipe(
        architecture="between", between=5, embedding=200, state=1000, noise=0.0, smooth=0.0, dropout=0.0,
        optimiser="sgd", learning_rate=0.1, weight_decay=0.0, batch=64, epochs=10, steps=0,
    ),
}  # fmt: skip


def locgen_recipe(name: str, epochs: int = 0) -> LocGenRecipe:
    """The recipe of a name; `epochs` other than 0 replaces its own."""
    recipe = _RECIPES[name]
    return replace(recipe, epochs=epochs, steps=0) if epochs else recipe

"""The networks of LocGen: from interpolated to natural motion, whatever the class (section 4.2, second stage)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import torch
from motionlake.glogen.locgen.interpolation import WIDTH
from motionlake.glogen.trajectories.sparse import HEIGHT
from torch import Tensor, nn

JOINT_SCALE: Final = 0.1  # body lengths
POSE: Final = HEIGHT + 1  # joints and height
MOVING: Final = POSE + 3  # and velocity and turning


class RowScale(nn.Module):
    """Rows of interpolated motion to numbers of about one; joints are scaled alike."""

    mean: Tensor
    scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(WIDTH))
        self.register_buffer("scale", torch.ones(WIDTH))

    def learn(self, rows: Tensor) -> None:
        """From interpolated rows [n, 66]."""
        self.mean.copy_(rows.mean(dim=0))
        self.scale.copy_(rows.std(dim=0).clamp(min=1e-3))
        self.scale[:HEIGHT] = JOINT_SCALE

    def forward(self, rows: Tensor) -> Tensor:
        return (rows - self.mean[: rows.shape[-1]]) / self.scale[: rows.shape[-1]]


class Frames(nn.Module):
    """Reads a whole motion frame by frame, both ways in time; gives what to add, and which foot stands."""

    def __init__(self, recipe: LocGenRecipe) -> None:
        super().__init__()
        self.recipe = recipe
        self.scale = RowScale()
        self.embed = nn.Sequential(nn.Linear(WIDTH, recipe.embedding), nn.GELU(), nn.Dropout(recipe.dropout))
        self.recurrent = nn.GRU(
            recipe.embedding, recipe.state // 2, 2, batch_first=True, bidirectional=True, dropout=recipe.dropout
        )
        self.out = nn.Linear(recipe.state, MOVING + 2)
        for parameter in self.out.parameters():  # starts from the interpolated poses themselves
            nn.init.zeros_(parameter)

    def forward(self, rows: Tensor) -> Tensor:
        """[B, T, 66] of interpolated rows [B, T, 66]: scaled joints, height, velocity and turning; logits of feet."""
        scaled = self.scale(rows)
        states, _ = self.recurrent(self.embed(scaled))
        found = self.out(states)
        return torch.cat([scaled[..., :MOVING] + found[..., :MOVING], found[..., MOVING:]], dim=-1)


class Between(nn.Module):
    """The thesis's: poses between two sparse poses, an encoder whose states all go to the decoder (equation 4.4)."""

    def __init__(self, recipe: LocGenRecipe) -> None:
        super().__init__()
        self.recipe = recipe
        self.scale = RowScale()
        self.embed = nn.Linear(POSE, recipe.embedding)
        self.encoder = nn.LSTM(recipe.embedding, recipe.state // 2, batch_first=True, bidirectional=True)
        self.decoder = nn.LSTM(recipe.state, recipe.state // 2, batch_first=True, bidirectional=True)
        self.out = nn.Linear(recipe.state, POSE)

    def forward(self, poses: Tensor) -> Tensor:
        """[B, M, 61] scaled natural poses, of M interpolated ones [B, M, 61] between two sparse poses."""
        states, _ = self.encoder(self.embed(self.scale(poses)))
        decoded, _ = self.decoder(states)
        return self.out(decoded)  # type: ignore[no-any-return]


def locgen_network(recipe: LocGenRecipe) -> Frames | Between:
    """An untrained network."""
    return Frames(recipe) if recipe.architecture == "frames" else Between(recipe)


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

"""The networks of LocGen: from interpolated to natural motion, whatever the class (section 4.2, second stage)."""

from __future__ import annotations

from typing import Final

import torch
from motionlake.glogen.locgen.interpolation import WIDTH
from motionlake.glogen.locgen.recipe import LocGenRecipe
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

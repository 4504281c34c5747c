"""Generator of the kind of HP-GAN: Barsoum et al., HP-GAN: Probabilistic 3D Human Motion Prediction via GAN (2017).

Taken over: an encoder-decoder whose decoder starts from the encoder's last state and a noise z; a fully connected
critic of past and future together, trained as in WGAN-GP (Gulrajani et al., Improved Training of Wasserstein GANs,
NIPS 2017), several steps to one of the generator; beside the critic's verdict, losses that keep steps between poses
small (consistency) and bones as long as those of the past. Different here: LSTM for GRU, the class prior stands beside
every pose and enters the critic, no second discriminator (it judges quality and trains nothing), and the critic's rate
is constant.

Best guess: the mean of the poses over `GUESSES` draws of z, which no single sample of the paper's is; samples are for
scores of distributions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, cast

import torch
from torch import Tensor, nn

from bench.glogen.baseline import Network, Shape, with_prior
from bench.glogen.decoder import Decoder

NOISE: Final = 64
CRITIC_STEPS: Final = 5
CRITIC_RATE: Final = 0.1  # of the generator's peak learning rate
CRITIC_WIDTH: Final = 256
PENALTY: Final = 10.0  # WGAN-GP's lambda
CONSISTENCY: Final = 0.1
BONE: Final = 1.0
GUESSES: Final = 16
Critic = Callable[[Tensor], Tensor]


class HpGan(Network):
    """Encoder LSTM, noise, decoder; against a critic that is trained beside it.

    Args:
        shape: of the task.
    """

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        hidden = shape.settings.hidden
        self._bones, self._centre = torch.tensor(shape.bones, dtype=torch.int64).reshape(-1, 2), shape.centre
        self.encoder = nn.LSTM(shape.entered, hidden, batch_first=True)
        self.start = nn.Linear(hidden + NOISE, hidden)
        self.decoder = Decoder(shape)
        seen = (shape.past + shape.horizon) * shape.width + shape.classes
        # In a tuple, so that its weights are none of the generator's.
        self._critic = (CriticNetwork(seen),)
        rate = CRITIC_RATE * shape.settings.budget.learning_rate
        self._optimiser = torch.optim.Adam(self._critic[0].parameters(), lr=rate, betas=(0.0, 0.9))

    def loss(self, past: Tensor, future: Tensor, prior: Tensor, done: float) -> Tensor:
        """The generator's; trains the critic before."""
        for _ in range(CRITIC_STEPS):
            with torch.no_grad():
                made = self._draw(past, prior, self._noise(past, None))
            self._teach(past, future, made, prior)
        made = self._draw(past, prior, self._noise(past, None))
        poses = torch.cat([past[:, -1:], made], dim=1)
        steps = (poses[:, 1:] - poses[:, :-1]).square().mean()
        found = -self._critic[0](seen_by_critic(past, made, prior)).mean() + CONSISTENCY * steps
        if len(self._bones):
            lengths = self.bone_lengths(poses)
            found = found + BONE * (lengths[:, 1:] - lengths[:, :1]).square().mean()
        return cast(Tensor, found)

    def extend(self, past: Tensor, prior: Tensor, chance: torch.Generator | None) -> Tensor:
        if chance is not None:
            return self._draw(past, prior, self._noise(past, chance))
        fixed = torch.Generator().manual_seed(0)
        noises = [self._noise(past[:1], fixed).expand(len(past), -1) for _ in range(GUESSES)]
        return torch.stack([self._draw(past, prior, noise) for noise in noises]).mean(dim=0)

    def bone_lengths(self, poses: Tensor) -> Tensor:
        """[B, T, bones] of normalised poses [B, T, D]."""
        joints = (poses + self._centre).reshape(*poses.shape[:2], -1, 3)
        found: Tensor = (joints[:, :, self._bones[:, 0]] - joints[:, :, self._bones[:, 1]]).norm(dim=3)
        return found

    def _noise(self, past: Tensor, chance: torch.Generator | None) -> Tensor:
        return torch.randn(len(past), NOISE, generator=chance)

    def _draw(self, past: Tensor, prior: Tensor, noise: Tensor) -> Tensor:
        _, (hidden, cell) = self.encoder(with_prior(past, prior))
        state = torch.tanh(self.start(torch.cat([hidden[0], noise], dim=1)))
        made: Tensor = self.decoder(past[:, -1], prior, (state, cell[0]))
        return made

    def _teach(self, past: Tensor, future: Tensor, made: Tensor, prior: Tensor) -> None:
        real, false = (seen_by_critic(past, poses, prior) for poses in (future, made))
        self._optimiser.zero_grad(set_to_none=True)
        critic_loss(self._critic[0], real, false).backward()  # type: ignore[no-untyped-call]
        self._optimiser.step()


class CriticNetwork(nn.Sequential):
    """Three fully connected layers: [B, seen] to verdicts [B]; greater is more real."""

    def __init__(self, seen: int, width: int = CRITIC_WIDTH) -> None:
        super().__init__(
            nn.Linear(seen, width), nn.LeakyReLU(0.2), nn.Linear(width, width), nn.LeakyReLU(0.2),
            nn.Linear(width, 1), nn.Flatten(0),
        )  # fmt: skip


def seen_by_critic(past: Tensor, future: Tensor, prior: Tensor) -> Tensor:
    """[B, (P + H) D + C]: a whole motion and its class in one row."""
    return torch.cat([past.flatten(1), future.flatten(1), prior], dim=1)


def critic_loss(critic: Critic, real: Tensor, false: Tensor) -> Tensor:
    """Verdict on what is false, less that on what is real, plus the penalty: what the critic makes small."""
    return critic(false).mean() - critic(real).mean() + PENALTY * gradient_penalty(critic, real, false)


def gradient_penalty(critic: Critic, real: Tensor, false: Tensor) -> Tensor:
    """Mean over points drawn between real and false rows [B, n] of (norm of the critic's gradient there - 1)^2."""
    share = torch.rand(len(real), 1)
    between = (share * real + (1 - share) * false).detach().requires_grad_(True)
    (slope,) = torch.autograd.grad(critic(between).sum(), between, create_graph=True)
    excess: Tensor = slope.norm(dim=1) - 1
    return excess.square().mean()

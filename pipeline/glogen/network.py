"""The networks of GloGen: sparse poses that follow a few sparse poses, of a class (section 4.2, first stage)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import torch
from motionlake.glogen.config import SEEDS, GloGenRecipe
from motionlake.glogen.sparse import JOINT_COLUMNS, WIDTH
from motionlake.glogen.start_poses import KNOWN, Beginnings
from torch import Tensor, nn
from torch.nn.functional import one_hot

MOST: Final = 20_000  # windows of motions that the regression, and of a class its beginnings, are learned from
JOINT_SCALE: Final = 0.1  # body lengths; all joints alike, so that errors stay distances


class PoseScale(nn.Module):
    """Sparse poses to numbers of about one, and back."""

    mean: Tensor
    scale: Tensor
    low: Tensor
    high: Tensor

    def __init__(self) -> None:
        super().__init__()
        for name in ("mean", "scale", "low", "high"):
            self.register_buffer(name, torch.ones(WIDTH))

    def learn(self, rows: Tensor) -> None:
        """From sparse poses [n, 65]."""
        flat = rows
        self.mean.copy_(flat.mean(dim=0))
        self.scale.copy_(flat.std(dim=0).clamp(min=1e-3))
        self.scale[JOINT_COLUMNS] = JOINT_SCALE
        self.low.copy_(flat.amin(dim=0))
        self.high.copy_(flat.amax(dim=0))

    def forward(self, rows: Tensor) -> Tensor:
        return (rows - self.mean) / self.scale

    def back(self, scaled: Tensor) -> Tensor:
        return scaled * self.scale + self.mean

    def within(self, rows: Tensor) -> Tensor:
        """Sparse poses with every number brought to where it was while training: what is fed back cannot run away."""
        return rows.clamp(self.low, self.high)


class GloGen(nn.Module):
    """What both architectures share: scaled poses in, scaled poses out.

    Attributes:
        scale: of the poses.
    """

    def __init__(self, recipe: GloGenRecipe, classes: int) -> None:
        super().__init__()
        self.recipe = recipe
        self.classes = classes
        self.scale = PoseScale()

    def learn(self, motions: Sequence[Tensor], targets: Tensor, going: Sequence[bool]) -> None:
        """The scale of poses, from motions [n, 65], each of any number of poses.

        Args:
            motions: sparse poses of each.
            targets: class of each.
            going: whether each class goes on.
        """
        self.scale.learn(torch.cat(list(motions)))

    @property
    def ahead(self) -> int:
        """How many poses one call gives."""
        return self.recipe.sparse - SEEDS

    def prior(self, targets: Tensor) -> Tensor:
        """[B, C] one-hot class prior."""
        return one_hot(targets, self.classes).float()

    def read(self, poses: Tensor, prior: Tensor) -> Tensor:
        """[B, E] what is made of the scaled poses [B, 5, 65] and their prior [B, C] before anything follows."""
        raise NotImplementedError

    def embedding(self, rows: Tensor, targets: Tensor | None = None) -> Tensor:
        """[B, n // 5 * E] what is made of each five poses of motions, one five after the other (section 4.4).

        Args:
            rows: [B, n, 65] scaled poses.
            targets: [B] classes, whose prior is read with the poses, as in figure 4.7; None: the poses alone.
        """
        fives = rows.shape[1] // SEEDS
        known = torch.zeros(len(rows), self.classes) if targets is None else self.prior(targets)
        poses = rows[:, : fives * SEEDS].reshape(-1, SEEDS, rows.shape[2])
        return self.read(poses, known.repeat_interleave(fives, dim=0)).reshape(len(rows), -1)


class Ahead(GloGen):
    """All poses that follow at once, read both ways in time, so that those to come shape those before them.

    They are what the recurrent layers add to the mean course of the class, led over to it from the last given poses by
    linear regression.
    """

    course: Tensor
    lead: Tensor

    def __init__(self, recipe: GloGenRecipe, classes: int) -> None:
        super().__init__(recipe, classes)
        width = recipe.embedding
        self.given = nn.Sequential(
            nn.Linear(SEEDS * WIDTH, 2 * width), nn.GELU(), nn.Dropout(recipe.dropout), nn.Linear(2 * width, width)
        )
        self.of_class = nn.Linear(classes, width)
        self.of_latent = nn.Linear(recipe.latent, width, bias=False)
        self.places = nn.Parameter(0.1 * torch.randn(self.ahead, width))
        self.register_buffer("course", torch.zeros(classes, recipe.sparse, WIDTH))
        self.register_buffer("lead", torch.zeros(self.ahead, 2))
        self.recurrent = nn.GRU(
            2 * width, recipe.state // 2, recipe.layers, batch_first=True, bidirectional=True, dropout=recipe.dropout
        )
        self.out = nn.Sequential(nn.Dropout(recipe.dropout), nn.Linear(recipe.state, WIDTH))
        self.seen = nn.GRU(WIDTH + width, width, batch_first=True, bidirectional=True)
        self.latent = nn.Linear(2 * width, 2 * recipe.latent)
        self.beginnings = Beginnings(classes, KNOWN)

    def learn(self, motions: Sequence[Tensor], targets: Tensor, going: Sequence[bool]) -> None:
        """The scale of poses, the mean course of every class, and how the last given poses lead over to it.

        The course of a class that goes on is its mean pose: its motions are at any phase.
        """
        super().learn(motions, targets, going)
        scaled = [self.scale(rows) for rows in motions]
        self._learn_beginnings(scaled, targets, going)
        for target in range(self.classes):
            own = [rows for rows, of in zip(scaled, targets.tolist(), strict=True) if of == target]
            if own and going[target]:
                self.course[target] = torch.cat(own).mean(dim=0)
            elif own:
                self.course[target] = torch.stack(own).mean(dim=0)
        places = [
            (i, start)
            for i, rows in enumerate(scaled)
            for start in range(0, max(1, len(rows) - self.recipe.sparse + 1))
            if len(rows) >= self.recipe.sparse
        ]
        if places:
            some = _some(places)
            windows = torch.stack([scaled[i][start : start + self.recipe.sparse] for i, start in some])
            self._learn_lead(windows, targets[[i for i, _ in some]])

    def _learn_beginnings(self, scaled: Sequence[Tensor], targets: Tensor, going: Sequence[bool]) -> None:
        places: list[list[tuple[int, int]]] = [[] for _ in range(self.classes)]
        for i, target in enumerate(targets.tolist()):
            last = len(scaled[i]) - SEEDS if going[target] else 0
            places[target] += [(i, start) for start in range(last + 1)]
        given = [[scaled[i][start : start + SEEDS] for i, start in _some(own)] for own in places]
        self.beginnings.learn([torch.stack(own) if own else torch.zeros(0) for own in given], going)

    def _learn_lead(self, scaled: Tensor, targets: Tensor) -> None:
        apart = _apart(scaled[:, :SEEDS], self.course[targets]).double()
        later = (scaled - self.course[targets])[:, SEEDS:].double()
        # Normal equations by sums in double precision: least squares of a library differ in their last digits.
        known = torch.stack([torch.stack([(a * b).sum() for b in apart.unbind(1)]) for a in apart.unbind(1)])
        wanted = torch.stack([(a[:, None] * later).sum(dim=(0, 2)) for a in apart.unbind(1)])
        known = known + 1e-9 * torch.trace(known).clamp(min=1e-12) * torch.eye(2, dtype=known.dtype)
        self.lead.copy_(torch.linalg.solve(known, wanted).T)

    def forward(self, given: Tensor, targets: Tensor, latent: Tensor) -> Tensor:
        """[B, 15, 65] scaled poses that follow the scaled poses `given` [B, 5, 65]; `latent` [B, L]."""
        prior = self.of_class(self.prior(targets))
        context = self.given(given.flatten(1)) + prior + self.of_latent(latent)
        inputs = torch.cat([context[:, None] + self.places, prior[:, None].expand(-1, self.ahead, -1)], dim=2)
        states, _ = self.recurrent(inputs)
        course = self.course[targets]
        led = torch.einsum("tk,bkd->btd", self.lead, _apart(given, course))
        return course[:, SEEDS:] + led + self.out(states)  # type: ignore[no-any-return]

    def read(self, poses: Tensor, prior: Tensor) -> Tensor:
        """[B, 128] of scaled poses [B, 5, 65]."""
        return self.given(poses.flatten(1)) + self.of_class(prior)  # type: ignore[no-any-return]

    def infer(self, rows: Tensor, targets: Tensor) -> tuple[Tensor, Tensor]:
        """Means and logarithms of variances [B, L] of the latent numbers of scaled motions [B, 20, 65]."""
        prior = self.of_class(self.prior(targets))
        states, _ = self.seen(torch.cat([rows, prior[:, None].expand(-1, rows.shape[1], -1)], dim=2))
        mean, logarithm = self.latent(states.mean(dim=1)).chunk(2, dim=1)
        return mean, logarithm.clamp(-6, 4)


def _some(places: Sequence[tuple[int, int]]) -> Sequence[tuple[int, int]]:
    """At most `MOST` of them, evenly chosen."""
    return places[:: -(-len(places) // MOST)] if len(places) > MOST else places


def _apart(given: Tensor, course: Tensor) -> Tensor:
    """[B, 2, 65] how far the last given pose is from the mean course, and the step to it from the step there."""
    apart = given - course[:, :SEEDS]
    return torch.stack([apart[:, -1], apart[:, -1] - apart[:, -2]], dim=1)


class Blocks(GloGen):
    """The thesis's: an encoder whose states all go to the decoder, five poses from five, iterated."""

    def __init__(self, recipe: GloGenRecipe, classes: int) -> None:
        super().__init__(recipe, classes)
        self.embed = nn.Linear(WIDTH + classes, recipe.embedding)
        ways = 2 if recipe.bidirectional else 1
        cell: type[nn.LSTM] | type[nn.GRU] = nn.LSTM if recipe.cell == "LSTM" else nn.GRU
        kind = {"num_layers": recipe.layers, "batch_first": True, "bidirectional": recipe.bidirectional}
        self.encoder = cell(recipe.embedding, recipe.state // ways, **kind)
        self.decoder = cell(recipe.state, recipe.state // ways, **kind)
        self.out = nn.Linear(recipe.state, WIDTH)

    def forward(self, given: Tensor, targets: Tensor, _latent: Tensor) -> Tensor:
        """[B, 15, 65] scaled poses that follow the scaled poses `given` [B, 5, 65]."""
        made = [given]
        while sum(block.shape[1] for block in made[1:]) < self.ahead:
            made.append(self.block(made[-1], targets))
        return torch.cat(made[1:], dim=1)[:, : self.ahead]

    def block(self, poses: Tensor, targets: Tensor) -> Tensor:
        """[B, 5, 65] the poses after [B, 5, 65] (equations 4.1 and 4.2)."""
        states = self.states(poses, targets)
        decoded, _ = self.decoder(states)
        return self.out(decoded)  # type: ignore[no-any-return]

    def states(self, poses: Tensor, targets: Tensor) -> Tensor:
        """[B, t, 1000] states of the encoder, one a pose."""
        encoded, _ = self.encoder(self._embedded(poses, self.prior(targets)))
        return encoded  # type: ignore[no-any-return]

    def read(self, poses: Tensor, prior: Tensor) -> Tensor:
        """[B, 1000] the embedded poses, one after the other, of [B, 5, 65]."""
        return self._embedded(poses, prior).flatten(1)

    def _embedded(self, poses: Tensor, prior: Tensor) -> Tensor:
        """[B, t, 200] poses [B, t, 65] with their class prior [B, C]."""
        return self.embed(torch.cat([poses, prior[:, None].expand(-1, poses.shape[1], -1)], dim=2))  # type: ignore[no-any-return]


def glogen_network(recipe: GloGenRecipe, classes: int) -> Ahead | Blocks:
    """An untrained network."""
    return Ahead(recipe, classes) if recipe.architecture == "ahead" else Blocks(recipe, classes)

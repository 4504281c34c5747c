"""GloGen: networks that predict sparse poses of a class from the five before them (section 4.2, first stage)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import torch
from motionlake.glogen.config import SEEDS, GloGenRecipe
from motionlake.glogen.sparse import JOINT_COLUMNS, WIDTH
from torch import Tensor, nn
from torch.nn.functional import one_hot

MOST: Final = 20_000  # windows of motions that regression and start poses are learned from
JOINT_SCALE: Final = 0.1  # body lengths; all joints alike, so that errors stay distances
KNOWN: Final = 16  # start poses kept of a cyclic class
REACH: Final = 0.9  # quantile of the distances of training poses from the start poses of their class
# How much nearer (in reaches) the start poses of another class are than those of the requested one: below OWN the given
# poses count as the class's own, above FOREIGN as foreign, and they are blended in between.
OWN: Final = 0.25
FOREIGN: Final = 0.5


class RowScale(nn.Module):
    """Standardises rows whose first columns are joints, or their first columns alone, and undoes it."""

    mean: Tensor
    scale: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(width))
        self.register_buffer("scale", torch.ones(width))

    def learn(self, rows: Tensor) -> None:
        """From rows [n, width]."""
        self.mean.copy_(rows.mean(dim=0))
        self.scale.copy_(rows.std(dim=0).clamp(min=1e-3))
        self.scale[JOINT_COLUMNS] = JOINT_SCALE

    def forward(self, rows: Tensor) -> Tensor:
        return (rows - self.mean[: rows.shape[-1]]) / self.scale[: rows.shape[-1]]

    def back(self, scaled: Tensor) -> Tensor:
        return scaled * self.scale[: scaled.shape[-1]] + self.mean[: scaled.shape[-1]]


class PoseScale(RowScale):
    """Standardises sparse poses; knows their range."""

    low: Tensor
    high: Tensor

    def __init__(self) -> None:
        super().__init__(WIDTH)
        self.register_buffer("low", torch.ones(WIDTH))
        self.register_buffer("high", torch.ones(WIDTH))

    def learn(self, rows: Tensor) -> None:
        """From sparse poses [n, 65]."""
        super().learn(rows)
        self.low.copy_(rows.amin(dim=0))
        self.high.copy_(rows.amax(dim=0))

    def within(self, rows: Tensor) -> Tensor:
        """Sparse poses clamped to the range of the training data, so that a rollout cannot drift away."""
        return rows.clamp(self.low, self.high)


class GloGen(nn.Module):
    """Base of both architectures: scaled poses in, scaled poses out.

    Attributes:
        scale: of the poses.
    """

    def __init__(self, recipe: GloGenRecipe, classes: int) -> None:
        super().__init__()
        self.recipe = recipe
        self.classes = classes
        self.scale = PoseScale()

    def learn(self, motions: Sequence[Tensor], targets: Tensor, cyclic: Sequence[bool]) -> None:
        """The scale of poses, from sparse poses [n, 65] of each motion, its class, and whether each class is cyclic."""
        self.scale.learn(torch.cat(list(motions)))

    @property
    def ahead(self) -> int:
        """Number of poses that one call predicts."""
        return self.recipe.sparse - SEEDS

    def prior(self, targets: Tensor) -> Tensor:
        """[B, C] one-hot class prior."""
        return one_hot(targets, self.classes).float()

    def read(self, poses: Tensor, prior: Tensor) -> Tensor:
        """[B, E] embedding of scaled poses [B, 5, 65] with their class prior [B, C]."""
        raise NotImplementedError

    def embedding(self, rows: Tensor, targets: Tensor | None = None) -> Tensor:
        """[B, n // 5 * E] embeddings of motions, five poses at a time (section 4.4).

        Args:
            rows: [B, n, 65] scaled poses.
            targets: [B] classes for the prior, as in figure 4.7; None: poses without a prior.
        """
        fives = rows.shape[1] // SEEDS
        known = torch.zeros(len(rows), self.classes) if targets is None else self.prior(targets)
        poses = rows[:, : fives * SEEDS].reshape(-1, SEEDS, rows.shape[2])
        return self.read(poses, known.repeat_interleave(fives, dim=0)).reshape(len(rows), -1)


class StartPoses(nn.Module):
    """Start poses of each class in the training data.

    Given the poses of another class, the network would predict a mixture of both classes. So foreign poses are replaced
    by the nearest start poses of the requested class, and the first predicted step bridges the gap.
    """

    poses: Tensor
    reach: Tensor

    def __init__(self, classes: int, known: int = 1) -> None:
        super().__init__()
        self.register_buffer("poses", torch.zeros(classes, known, SEEDS, WIDTH))
        self.register_buffer("reach", torch.ones(()))

    def learn(self, given: Sequence[Tensor], cyclic: Sequence[bool]) -> None:
        """Keep the mean of the scaled start poses [n, 5, 65] of a class, or the most different ones of a cyclic class.

        The reach is the median over classes.
        """
        reaches = []
        for target, (own, on) in enumerate(zip(given, cyclic, strict=True)):
            if len(own):
                known = _different(own, self.poses.shape[1]) if on else own.mean(dim=0, keepdim=True)
                self.poses[target] = known[torch.arange(self.poses.shape[1]) % len(known)]
                reaches.append(torch.quantile(_between(own, self.poses[target]).amin(dim=1), REACH))
        if reaches:
            self.reach.copy_(torch.stack(reaches).median().clamp(min=1e-6))

    def distances(self, given: Tensor) -> Tensor:
        """[B, C] of scaled given poses [B, 5, 65] from the nearest start poses of every class, in reaches."""
        return torch.stack([_between(given, known).amin(dim=1) for known in self.poses], dim=1) / self.reach

    def forward(self, given: Tensor, targets: Tensor, anew: Tensor) -> Tensor:
        """[B, 5, 65] scaled given poses; foreign ones become the nearest start poses of the requested class.

        Args:
            given: [B, 5, 65].
            targets: [B] class requested.
            anew: [B] whether the class starts after these poses, which then count as foreign.
        """
        to_all = torch.stack([_between(given, known) for known in self.poses], dim=1)  # [B, C, K]
        rows = torch.arange(len(given))
        apart, place = to_all[rows, targets].min(dim=1)
        further = (apart - to_all.amin(dim=(1, 2))) / self.reach
        foreign = ((further - OWN) / (FOREIGN - OWN)).clamp(0, 1)
        foreign = torch.where(anew, 1.0, foreign)
        return torch.lerp(given, self.poses[targets, place], foreign[:, None, None])


def _between(given: Tensor, known: Tensor) -> Tensor:
    """[n, k] root mean square distance of the joints of the last poses of [n, 5, 65] and [k, 5, 65]."""
    apart = given[:, None, -1, JOINT_COLUMNS] - known[None, :, -1, JOINT_COLUMNS]
    return apart.square().mean(dim=2).sqrt()


def _different(given: Tensor, count: int) -> Tensor:
    """Up to `count` of [n, 5, 65], each the furthest from those before it; the first is the nearest to the mean."""
    chosen = [int(_between(given, given.mean(dim=0, keepdim=True))[:, 0].argmin())]
    apart = _between(given, given[chosen])[:, 0]
    while len(chosen) < count and float(apart.max()) > 0:
        chosen.append(int(apart.argmax()))
        apart = torch.minimum(apart, _between(given, given[chosen[-1:]])[:, 0])
    return given[chosen]


class ParallelDecoder(GloGen):
    """Predicts all poses at once by a bidirectional recurrent network, so that later poses shape earlier ones.

    The network predicts the difference from the mean motion of the class; linear regression carries the offset of the
    last given poses over to it.
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
        self.beginnings = StartPoses(classes, KNOWN)

    def learn(self, motions: Sequence[Tensor], targets: Tensor, cyclic: Sequence[bool]) -> None:
        """The scale of poses, the mean motion of every class, and the regression from given poses to it.

        Of a cyclic class the mean motion is its mean pose, since its clips start at any phase.
        """
        super().learn(motions, targets, cyclic)
        scaled = [self.scale(rows) for rows in motions]
        self._learn_beginnings(scaled, targets, cyclic)
        for target in range(self.classes):
            own = [rows for rows, of in zip(scaled, targets.tolist(), strict=True) if of == target]
            if own and cyclic[target]:
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

    def _learn_beginnings(self, scaled: Sequence[Tensor], targets: Tensor, cyclic: Sequence[bool]) -> None:
        places: list[list[tuple[int, int]]] = [[] for _ in range(self.classes)]
        for i, target in enumerate(targets.tolist()):
            last = len(scaled[i]) - SEEDS if cyclic[target] else 0
            places[target] += [(i, start) for start in range(last + 1)]
        given = [[scaled[i][start : start + SEEDS] for i, start in _some(own)] for own in places]
        self.beginnings.learn([torch.stack(own) if own else torch.zeros(0) for own in given], cyclic)

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
        """Means and logarithms of variances [B, L] of the latent variables of scaled motions [B, 20, 65]."""
        prior = self.of_class(self.prior(targets))
        states, _ = self.seen(torch.cat([rows, prior[:, None].expand(-1, rows.shape[1], -1)], dim=2))
        mean, logarithm = self.latent(states.mean(dim=1)).chunk(2, dim=1)
        return mean, logarithm.clamp(-6, 4)


def _some(places: Sequence[tuple[int, int]]) -> Sequence[tuple[int, int]]:
    """At most `MOST` of them, evenly chosen."""
    return places[:: -(-len(places) // MOST)] if len(places) > MOST else places


def _apart(given: Tensor, course: Tensor) -> Tensor:
    """[B, 2, 65] offset of the last given pose from the mean motion, and of the step before it."""
    apart = given - course[:, :SEEDS]
    return torch.stack([apart[:, -1], apart[:, -1] - apart[:, -2]], dim=1)


class Seq2Seq(GloGen):
    """The thesis's sequence-to-sequence network: it predicts five poses from five, again and again."""

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


def glogen_network(recipe: GloGenRecipe, classes: int) -> ParallelDecoder | Seq2Seq:
    """An untrained network."""
    return ParallelDecoder(recipe, classes) if recipe.architecture == "ahead" else Seq2Seq(recipe, classes)

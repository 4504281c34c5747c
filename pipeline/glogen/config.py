"""Configuration of synthesis, and how GloGen is built and trained, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

from motionlake.weights import Pretrained

AUTO: Final = "auto"
MATCHING: Final = "matching"
NETWORKS: Final = "networks"
RECIPES: Final = (AUTO, MATCHING, NETWORKS, "glogen")
EARLIER: Final = {"default": NETWORKS}  # names that recipes had
_TRAINED: Final = {**EARLIER, AUTO: NETWORKS}  # by which networks are trained
WEIGHTS: Final = ("auto", "pretrained", "own")


@dataclass(frozen=True)
class SynthesisConfig:
    """Which generator makes new motion.

    Attributes:
        recipe: "matching": motion matching, which plays recorded frames and trains nothing; "networks", or "glogen",
            the thesis's (sections 4.2 and 4.3); "auto": motion matching of classes that recordings of the lake are
            labelled with, networks of others.
        seed: of training.
        epochs: of training of networks; 0 takes the recipe's.
        weights: what a lake without a generator starts with: "own" makes one of clips of known class, "pretrained"
            takes the pretrained networks where they fit this configuration, "auto" does so where no clip's class is
            known.

    Raises:
        ValueError: an unknown name, or a value out of range.
    """

    recipe: str = AUTO
    seed: int = 0
    epochs: int = 0
    weights: str = "auto"

    def __post_init__(self) -> None:
        object.__setattr__(self, "recipe", EARLIER.get(self.recipe, self.recipe))
        if self.recipe not in RECIPES:
            raise ValueError(f"recipe is {self.recipe!r}, not one of {', '.join(RECIPES)}")
        if self.weights not in WEIGHTS:
            raise ValueError(f"weights is {self.weights!r}, not one of {', '.join(WEIGHTS)}")
        if self.epochs < 0:
            raise ValueError(f"epochs = {self.epochs}: cannot be negative")

    def resolved(self, labelled: bool) -> SynthesisConfig:
        """The same with the recipe that "auto" stands for in a lake with labelled recordings, or without any."""
        if self.recipe != AUTO:
            return self
        return replace(self, recipe=MATCHING if labelled and self.weights != "pretrained" else NETWORKS)

    def networks(self) -> SynthesisConfig:
        """The same for networks."""
        return replace(self, recipe=NETWORKS)

    def kept(self) -> dict[str, Any]:
        """As lakes and files keep it: networks by the name that they had first."""
        names = {now: then for then, now in EARLIER.items()}
        return asdict(self) | {"recipe": names.get(self.recipe, self.recipe)}


def _same_generator(about: Mapping[str, Any], config: SynthesisConfig) -> bool:
    recipe = EARLIER.get(about["recipe"], about["recipe"])
    return config.weights != "own" and not config.epochs and config.recipe in (AUTO, recipe)


PRETRAINED_GENERATOR: Final = Pretrained(Path(__file__).parent / "weights" / "generator.safetensors", _same_generator)


SPARSE: Final = 20  # sparse poses that stand for a motion
SEEDS: Final = 5  # t: sparse poses that are given


@dataclass(frozen=True)
class Schedule:
    """How any of the networks is trained.

    Attributes:
        epochs, steps: so many epochs, more where these have fewer steps than `steps`.
    """

    dropout: float = 0.2
    optimiser: Literal["adam", "sgd", "momentum"] = "adam"
    learning_rate: float = 2e-3
    weight_decay: float = 0.01
    batch: int = 64
    epochs: int = 40
    steps: int = 250


@dataclass(frozen=True)
class Recipe(Schedule):
    """Sizes and training that GloGen and LocGen have.

    Attributes:
        embedding, state: widths of the pose embedding and of the recurrent layers (both directions together).
        noise: of the sparse poses that are given while training, body lengths.
        smooth: weight of the error of differences from pose to pose.
    """

    embedding: int = 128
    state: int = 256
    noise: float = 0.02
    smooth: float = 1.0

    def batches(self, count: int) -> int:
        """How many batches `count` motions make."""
        return max(1, round(count / self.batch))


@dataclass(frozen=True)
class GloGenRecipe(Recipe):
    """Sizes and training of GloGen.

    Attributes:
        architecture: "ahead": predicts all poses at once (`ParallelDecoder`); "blocks": the thesis's `Seq2Seq`,
            five poses from five, again and again (equations 4.1 and 4.2).
        sparse: number of sparse poses that represent a motion.
        layers, bidirectional, cell: of the recurrent layers ("LSTM" or "GRU"); the ablations of table 4.4.
        latent: number of latent variables; 0: none.
        divergence: weight of the divergence of the latent variables from their prior.
        going_steps: `steps` for cyclic classes, whose rollouts feed predictions back many times: a network trained for
            less ends up standing still.
        going_dropout: `dropout` for cyclic classes.
        again: frames between the starts of neighbouring pieces of clips of cyclic classes.
        missing: share of the joints of given poses that training hides by their mean.
    """

    architecture: Literal["ahead", "blocks"] = "ahead"
    sparse: int = SPARSE
    layers: int = 2
    bidirectional: bool = True
    cell: Literal["LSTM", "GRU"] = "GRU"
    latent: int = 16
    divergence: float = 0.0001
    going_dropout: float = 0.0
    again: int = 10
    missing: float = 0.0
    mirror: bool = False
    going_steps: int = 1000

    def epochs_of(self, count: int, cyclic: bool) -> int:
        """How many epochs are trained on `count` motions, of which some may be of cyclic classes."""
        steps = max(self.steps, self.going_steps * cyclic)
        return max(self.epochs, -(-steps // self.batches(count)))


@dataclass(frozen=True)
class LocGenRecipe(Recipe):
    """Sizes and training of LocGen.

    Attributes:
        architecture: "frames": reads a whole interpolated motion at 30 frames a second; "between": the thesis's, reads
            the poses between two sparse poses alone.
        between: M of equation 4.3, poses from one sparse pose to the next; "frames" takes as many as the time holds.
    """

    architecture: Literal["frames", "between"] = "frames"
    between: int = 0
    state: int = 192
    noise: float = 0.004
    smooth: float = 4.0
    dropout: float = 0.1
    batch: int = 16
    epochs: int = 20
    steps: int = 200

    def epochs_of(self, count: int) -> int:
        """How many epochs are trained on `count` pieces."""
        return max(self.epochs, -(-self.steps // self.batches(count)))


@dataclass(frozen=True)
class OnsetRecipe(Schedule):
    """Size and training of the network of the onset.

    Attributes:
        width, blocks: of its hidden layers.
        steps: of training for one class, and `more` for each other one.
        epoch: steps that are told of as one.
        epochs: so many, whatever the steps; 0: as many as these make.
    """

    width: int = 256
    blocks: int = 2
    dropout: float = 0.1
    epochs: int = 0
    steps: int = 2000
    more: int = 500
    epoch: int = 50

    def epochs_of(self, classes: int) -> int:
        """How many epochs are trained for so many classes with examples."""
        return self.epochs or -(-(self.steps + self.more * (classes - 1)) // self.epoch)


# Sections 4.2 and 4.3: pose embedding 200, state 1000, SGD at 0.1, batches of 64, mean squared error; LocGen the same
# without classes, M = 5. For how many epochs is not said: GloGen's loss on a subject held out of the training split of
# utd_mhad falls for 130, with momentum, without which it has not learned then.
_THESIS: Final[dict[str, Any]] = {
    "embedding": 200, "state": 1000, "dropout": 0.0, "smooth": 0.0, "noise": 0.0, "optimiser": "momentum",
    "learning_rate": 0.1, "weight_decay": 0.0, "batch": 64, "steps": 0,
}  # fmt: skip
_GLOGEN: Final = {
    NETWORKS: GloGenRecipe(),
    "glogen": GloGenRecipe(
        **_THESIS,
        architecture="blocks",
        layers=1,
        cell="LSTM",
        latent=0,
        divergence=0.0,
        again=0,
        going_steps=0,
        epochs=130,
    ),
}
_LOCGEN: Final = {
    NETWORKS: LocGenRecipe(),
    "glogen": LocGenRecipe(**_THESIS, architecture="between", between=5, epochs=20),
}


def glogen_recipe(name: str, epochs: int = 0) -> GloGenRecipe:
    """The recipe of a name; `epochs` other than 0 replaces its own."""
    found = _GLOGEN[_TRAINED.get(name, name)]
    return replace(found, epochs=epochs, steps=0, going_steps=0) if epochs else found


def locgen_recipe(name: str, epochs: int = 0) -> LocGenRecipe:
    """As `glogen_recipe`."""
    found = _LOCGEN[_TRAINED.get(name, name)]
    return replace(found, epochs=epochs, steps=0) if epochs else found


def onset_recipe(epochs: int = 0) -> OnsetRecipe:
    """The recipe of the onset; `epochs` other than 0 replaces its own."""
    return OnsetRecipe(epochs=epochs)

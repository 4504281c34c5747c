"""Configuration of the posture dictionary."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal

from motionlake.motion.features import Representation, WordConfig
from motionlake.ready_made import described

DictionaryKind = Literal["aae", "kmeans", "som"]
RecipeName = Literal["default", "pesta"]
KINDS: Final = ("aae", "kmeans", "som")
ENOUGH: Final = 25
RECIPES: Final = ("default", "pesta")


@dataclass(frozen=True)
class PosturesConfig:
    """What a posture is, and which dictionary turns it into a symbol.

    Attributes:
        dictionary: "aae" (clustering adversarial autoencoder), "kmeans" or "som" (self-organising map).
        m: number of symbols.
        seed: of training.
        weights: what a lake without a dictionary starts with: "shipped" takes the ready-made one where it fits this
            configuration, "own" trains on the lake's clips, "auto" (default) does so where they hold enough postures,
            `ENOUGH` for each symbol, since a dictionary of the clips' own retrieves much better (`docs/postures.md`).
        recipe: of the autoencoder: "default", or "pesta", the paper's (5,000 epochs).
        max_postures: size of the sample of postures that a dictionary is trained on.
        representation: "positions" of joints seen from the body, or "rotations" (the paper's quaternions).
        fps: postures a second: a quarter of 120.
        root_weight: "positions" only: weight of the root's velocity and yaw rate in a posture; 0 leaves them out.
        velocity_weight: "positions" only: weight of the joints' velocities; 0 leaves them out.
        smoothing: "positions" only: standard deviation, in postures, of the Gaussian that smooths them in time.

    Raises:
        ValueError: an unknown name, or a value out of range.
    """

    dictionary: DictionaryKind = "aae"
    m: int = 400
    seed: int = 0
    weights: str = "auto"
    recipe: RecipeName = "default"
    max_postures: int = 30_000
    representation: Representation = "positions"
    fps: float = 30.0
    root_weight: float = 10.0
    velocity_weight: float = 8.0
    smoothing: float = 1.0

    def __post_init__(self) -> None:
        if self.dictionary not in KINDS:
            raise ValueError(f"dictionary is {self.dictionary!r}, not one of {', '.join(KINDS)}")
        if self.recipe not in RECIPES:
            raise ValueError(f"recipe is {self.recipe!r}, not one of {', '.join(RECIPES)}")
        if self.weights not in ("auto", "shipped", "own"):
            raise ValueError(f"weights is {self.weights!r}, not auto, shipped or own")
        if self.m < 2 or self.max_postures < self.m:
            raise ValueError(
                f"m = {self.m} symbols of {self.max_postures} postures: at least 2, and no more than those"
            )
        _ = self.frames

    @classmethod
    def pesta(cls) -> PosturesConfig:
        """The paper's: quaternions of single frames, the autoencoder trained for 5,000 epochs (section 5.2)."""
        return cls(
            weights="own", recipe="pesta", representation="rotations",
            root_weight=0.0, velocity_weight=0.0, smoothing=0.0,
        )  # fmt: skip

    @property
    def frames(self) -> WordConfig:
        """How a clip becomes rows of features: a posture is a word of one frame."""
        joints: Literal["common15", "deep_motifs16"] = (
            "common15" if self.representation == "positions" else "deep_motifs16"
        )
        return WordConfig(
            self.representation, self.fps, 1, 1, joints, self.root_weight, self.velocity_weight, self.smoothing
        )


FILE = Path(__file__).parent / "weights" / "postures-aae.safetensors"
# What shapes a training alone; frames are coded alike whatever these say.
_OF_TRAINING = ("seed", "weights", "max_postures")


def about() -> dict[str, Any]:
    """What stands beside the weights: configuration, sets and sha256 of the clips; empty where there are none."""
    return described(FILE)


def fits(config: PosturesConfig) -> bool:
    """Whether a lake of this configuration may be coded with the ready-made dictionary."""
    return config.weights != "own" and "postures" in about() and _coding(asdict(config)) == _coding(about()["postures"])


def _coding(config: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in config.items() if name not in _OF_TRAINING}

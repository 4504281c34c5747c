"""Configuration of posture dictionaries, symbol strings and their alignment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal, get_args

from motionlake.motion.features import Representation, WordConfig
from motionlake.weights import Pretrained

Method = Literal["sta", "dtw", "sw"]

# Symbols; a cell costs time as the square of the stride, and memory as the stride times the query.
MAX_STRIDE: Final = 64
METHODS: Final[tuple[Method, ...]] = get_args(Method)


@dataclass(frozen=True)
class AlignmentConfig:
    """Which alignment, and its constants.

    Attributes:
        method: "sta", strided temporal alignment (section 6); "dtw", sub-sequence dynamic time warping, which is the
            same recurrence with its three direct neighbours, stride 1; "sw", Smith-Waterman local alignment as Wu et
            al. apply it to strings of postures.
        stride: w of section 6, from 1 to `MAX_STRIDE`; "dtw" and "sw" do not look at it. The paper takes 3 for whole
            sequences and for sub-sequences by whole queries, 2 for sub-queries.
        threshold: "sw" alone: two symbols are alike by (threshold - distance), in units of the mean distance of two
            different symbols of the dictionary.
        gap: "sw" alone: what a symbol that is left out of either string costs, in the same unit.
        gaps: "sta" alone: symbols may be left out of the clip and of the query, which is robust to clips with pieces of
            other motions in them. Off, as in the paper: a path pays for every symbol that it does not stride over.
        clip_gap: with `gaps`, what a symbol that is left out of the clip costs, in the same unit.
        query_gap: with `gaps`, what a symbol that is left out of the query costs, in the same unit.

    Raises:
        ValueError: a method that does not exist, a stride out of range, a threshold or gap that is not above zero, gaps
            of another method than "sta".
    """

    method: Method = "sta"
    stride: int = 2
    threshold: float = 0.7
    gap: float = 0.1
    gaps: bool = False
    clip_gap: float = 0.05
    query_gap: float = 0.6

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method is {self.method!r}, not one of {', '.join(METHODS)}")
        if isinstance(self.stride, bool) or not isinstance(self.stride, int) or not 1 <= self.stride <= MAX_STRIDE:
            raise ValueError(f"stride is {self.stride}: it is a whole number from 1 to {MAX_STRIDE}")
        for name in ("threshold", "gap", "clip_gap", "query_gap"):
            value = getattr(self, name)
            if not 0 < value < float("inf"):
                raise ValueError(f"{name} is {value}: it must be above zero")
        if self.gaps and self.method != "sta":
            raise ValueError(f'gaps are an option of "sta"; {self.method} has none that could be switched on')

    @property
    def reach(self) -> int:
        """How many columns back a cell looks: the stride, or 1."""
        return self.stride if self.method == "sta" else 1

    @property
    def local(self) -> bool:
        """Whether a match may cover a part of the query only."""
        return self.method == "sw"

    def by(self, method: Method) -> AlignmentConfig:
        """The same by another method; one that is not "sta" has no gaps."""
        return replace(self, method=method, gaps=self.gaps and method == "sta")

    @property
    def spec(self) -> dict[str, Any]:
        """What makes answers differ, as keyword arguments; that of a configuration without gaps has nothing of them."""
        return {name: value for name, value in asdict(self).items() if self.gaps or name not in _OF_GAPS}


_OF_GAPS: Final = ("gaps", "clip_gap", "query_gap")
DEFAULT_ALIGNMENT: Final = AlignmentConfig()
DictionaryKind = Literal["neural_gas", "kmeans", "som", "information", "adversarial"]
KINDS: Final[tuple[DictionaryKind, ...]] = get_args(DictionaryKind)
CLUSTERED: Final[tuple[DictionaryKind, ...]] = ("neural_gas", "kmeans", "som")  # the others are networks
ENOUGH: Final = 5
DICTIONARY_KEY: Final = "posture_dictionary"  # of the metadata of a dictionary's file


@dataclass(frozen=True)
class PosturesConfig:
    """What a posture is, and which dictionary turns it into a symbol.

    Attributes:
        dictionary: "neural_gas", "kmeans", "som" (self-organising map), or a clustering autoencoder whose classes are
            shaped by mutual information ("information") or by a critic, as the paper does ("adversarial").
        m: number of symbols.
        seed: of training.
        weights: what a lake without a dictionary starts with: "pretrained" takes the pretrained one where it fits this
            configuration, "own" trains on the lake's clips, "auto" (default) does so where they hold enough postures,
            `ENOUGH` for each symbol, since a dictionary of the clips' own retrieves much better (`docs/postures.md`).
        max_postures: size of the sample of postures that a dictionary is trained on.
        whitened: `CLUSTERED` alone: clusters are looked for where postures differ as little from those of other
            clips in every direction, and not in the space of the features.
        softness: "neural_gas" and "kmeans" alone: how far the heads of neighbouring clusters lean to each other, in
            ranks of heads or in mean square distances of postures from their heads; 0: not at all.
        representation: "positions" of joints seen from the body, or "rotations" (the paper's quaternions).
        fps: postures a second: a quarter of 120.
        root_weight: "positions" only: weight of the root's velocity and yaw rate in a posture; 0 leaves them out.
        velocity_weight: "positions" only: weight of the joints' velocities; 0 leaves them out.
        smoothing: "positions" only: standard deviation, in postures, of the Gaussian that smooths them in time.

    Raises:
        ValueError: an unknown name, or a value out of range.
    """

    dictionary: DictionaryKind = "neural_gas"
    m: int = 400
    seed: int = 0
    weights: str = "auto"
    max_postures: int = 30_000
    whitened: bool = True
    softness: float = 1.25
    representation: Representation = "positions"
    fps: float = 30.0
    root_weight: float = 10.0
    velocity_weight: float = 8.0
    smoothing: float = 1.0

    def __post_init__(self) -> None:
        if self.dictionary not in KINDS:
            raise ValueError(f"dictionary is {self.dictionary!r}, not one of {', '.join(KINDS)}")
        if self.weights not in ("auto", "pretrained", "own"):
            raise ValueError(f"weights is {self.weights!r}, not auto, pretrained or own")
        if self.m < 2 or self.max_postures < self.m:
            raise ValueError(
                f"m = {self.m} symbols of {self.max_postures} postures: at least 2, and no more than those"
            )
        if not 0 <= self.softness < float("inf"):
            raise ValueError(f"softness is {self.softness}: it cannot be negative")
        _ = self.frames

    @classmethod
    def pesta(cls) -> PosturesConfig:
        """The paper's: quaternions of single frames, the autoencoder trained for 5,000 epochs (section 5.2)."""
        return cls(
            dictionary="adversarial", weights="own", representation="rotations",
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


def _same_postures(about: Mapping[str, Any], config: PosturesConfig) -> bool:
    """Whether frames are coded alike; seed, weights and max_postures shape a training alone."""

    def coding(settings: Mapping[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in settings.items() if name not in ("seed", "weights", "max_postures")}

    return config.weights != "own" and coding(asdict(config)) == coding(about["postures"])


PRETRAINED_POSTURES: Final = Pretrained(
    Path(__file__).parent / "weights" / "postures-neural-gas.safetensors", _same_postures
)


@dataclass(frozen=True)
class SymbolsConfig:
    """What is reduced (PESTA, section 5.3); both off keeps speed and cycle counts (section 8.5.2).

    Attributes:
        runs: of a run of one symbol one is kept. Off: how long a posture is held stays in the string.
        repeats: of a tandem repeat one instance is kept. Off: how often a pattern is repeated stays. On with
            runs off, a pattern counts as repeated where its runs are, lengths included (aabaab becomes aab,
            aabaaab stays, and so does aaaa).
    """

    runs: bool = True
    repeats: bool = True

"""What every kind of model has: when it fits, what it is trained on, and how it is trained, saved and taken pretrained.

A model is frozen once it is made: the next one is a new version, and stages that need it notice by its name or hash.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, Generic, Protocol, TypeVar

from motionlake.arrays import Progress
from motionlake.errors import UserError
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, checkpoint_file, copy_weights, fitting_model, save_model
from motionlake.stages.reader import LakeReader
from motionlake.weights import Pretrained

Data = TypeVar("Data")
CHOSEN: Final = ("split", "dataset", "min_quality")  # options of a kind that is trained on chosen clips


@dataclass(frozen=True)
class Selection:
    """Which clips of a lake a model is trained on.

    Attributes:
        split: those of this split of labels.csv; None: of any.
        dataset: those of this dataset; None: of any.
        min_quality: those with this verdict at worst (`lake.verdicts`); None: with any.
        fine_tune: go on from the current model, else from the pretrained one, where the kind can.
    """

    split: str | None = None
    dataset: str | None = None
    min_quality: str | None = None
    fine_tune: bool = False


class Trained(Protocol):
    """A model in memory: what training gave, or what its file holds."""

    @property
    def metrics(self) -> Mapping[str, Any]:
        """Sizes, losses and what else its training gave: JSON values."""

    def save(self, path: Path) -> None:
        """Write it as one file."""


class ModelKind(ABC, Generic[Data]):
    """One kind of model that a lake trains, or takes pretrained.

    Attributes:
        name: as the table `models` calls it.
        version: of how it is made; another one makes all models anew.
        config: dataclass of the table of config.toml that shapes it.
        title: for people.
        use: what it does with what it is for, after its name in a sentence.
        lacks: what a lake lacks in which there is nothing to train it on.
        command: name of `motionlake train`; "" where only `motionlake run STAGE --refit` makes it anew.
        help: text of that command; `{lake}` in `said`, the line after training, is the lake, other names are metrics.
        options: of that command, fields of `Selection` or of `config`.
        suffix: of its file.
        pretrained: weights that come with the package.
        kept: metrics that pretrained weights bring into a lake.
    """

    name: ClassVar[str]
    version: ClassVar[int] = 1
    config: ClassVar[type[Any]]
    title: ClassVar[str]
    use: ClassVar[str]
    lacks: ClassVar[str] = "frames to train on yet; take clips in with `motionlake ingest`"
    command: ClassVar[str] = ""
    help: ClassVar[str] = ""
    said: ClassVar[str] = ""
    options: ClassVar[tuple[str, ...]] = ()
    suffix: ClassVar[str] = ".safetensors"
    pretrained: ClassVar[Pretrained | None] = None
    kept: ClassVar[tuple[str, ...]] = ()

    def key(self, at: LakeReader) -> str | None:
        """sha256 over all that shapes a model but the clips it is trained on; None where it hangs on another model
        that is not made yet."""
        return config_hash(self.name, self.version, at.config.of(self.config))

    def settings(self, config: LakeConfig) -> Mapping[str, Any]:
        """What `models` keeps of the configuration."""
        return asdict(config.of(self.config))

    def fitting(self, at: LakeReader) -> Model | None:
        """The current model if it was made for this configuration."""

        def find() -> Model | None:
            key = self.key(at)
            return None if key is None else fitting_model(at.con, self.name, key)

        return at.once("model", self.name, find)

    def serving(self, at: LakeReader) -> Model:
        """The model that fits, for a stage that plans only where there is one."""
        model = self.fitting(at)
        assert model is not None, f"no {self.title} yet"
        return model

    def fits(self, config: LakeConfig) -> bool:
        """Whether a lake of this configuration may take the pretrained model."""
        return self.pretrained is not None and self.pretrained.fits(config.of(self.config))

    def takes_pretrained(self, at: LakeReader) -> bool:
        """Whether a lake without a fitting model starts with the pretrained one, and does not train."""
        return self.fits(at.config)

    def announce(self, at: LakeReader) -> str:
        """What training would make, for people: "will ..."."""
        return f"will train a {self.title}"

    @abstractmethod
    def data(self, at: LakeReader, where: Selection) -> Data | None:
        """What to train on; None where there is nothing.

        Raises:
            UserError: what was selected is not there, or cannot be trained on.
        """

    @abstractmethod
    def fit(self, lake: Lake, config: LakeConfig, data: Data, checkpoint: Path, progress: Progress) -> Trained:
        """Train. A training that was interrupted goes on from its checkpoint.

        `data_sha256` among the metrics says what it was trained on, by default the whole lake.

        Raises:
            ValueError: there is too little to train on.
        """

    @abstractmethod
    def load(self, path: Path) -> Trained:
        """Read a model from its file.

        Raises:
            ValueError: the file holds something else.
        """

    def train(self, lake: Lake, config: LakeConfig, data: Data, file: str, progress: Progress) -> Mapping[str, Any]:
        """Train, and save as `file` of the lake; returns the metrics.

        Raises:
            UserError: there is too little to train on.
        """
        try:
            trained = self.fit(lake, config, data, checkpoint_file(lake, self.name), progress)
        except ValueError as error:
            raise UserError(f"{lake.root}: no {self.title} can be trained: {error}") from error
        save_model(lake, file, trained.save)
        return dict(trained.metrics)

    def take(self, lake: Lake, config: LakeConfig, weights: Path, file: str) -> Mapping[str, Any]:
        """Copy pretrained weights into the lake as `file`; returns the metrics of their training.

        Raises:
            ValueError: they do not fit the configuration.
        """
        return copy_weights(lake, weights, file, self.load(weights).metrics, *self.kept)

    def hints(self, config: LakeConfig, metrics: Mapping[str, Any]) -> list[str]:
        """What a person should know of a model that was just trained."""
        return []

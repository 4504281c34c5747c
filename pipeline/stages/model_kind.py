"""What every kind of model has: when it fits, what it is trained on, and how it is trained, saved and taken pretrained.

A model is frozen once it is made: the next one is a new version, and stages that need it notice by its name or hash.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, copy_weights, fitting_model
from motionlake.pretrained import Pretrained
from motionlake.stages.reader import LakeReader

Data = TypeVar("Data")
Steps = Callable[[int, int, float], None]  # told of (steps done, steps, loss)


@dataclass(frozen=True)
class Selection:
    """Which clips of a lake a model is trained on.

    Attributes:
        split: those of this split of labels.csv; None: of any.
        dataset: those of this dataset; None: of any.
        fine_tune: go on from the current model, else from the pretrained one, where the kind can.
    """

    split: str | None = None
    dataset: str | None = None
    fine_tune: bool = False


class ModelKind(ABC, Generic[Data]):
    """One kind of model that a lake trains, or takes pretrained.

    Attributes:
        name: as the table `models` calls it.
        version: of how it is made; another one makes all models anew.
        table: of config.toml that shapes it.
        title: for people.
        command: name of `motionlake train`; "" where only `motionlake run STAGE --refit` makes it anew.
        use: what it does with what it is for, after its name in a sentence.
        lacks: what a lake lacks in which there is nothing to train it on.
        suffix: of its file.
        pretrained: weights that come with the package.
        kept: metrics that pretrained weights bring into a lake.
    """

    name: ClassVar[str]
    version: ClassVar[int] = 1
    table: ClassVar[str]
    title: ClassVar[str]
    command: ClassVar[str] = ""
    use: ClassVar[str]
    lacks: ClassVar[str] = "frames yet; `motionlake ingest` takes clips in"
    suffix: ClassVar[str] = ".safetensors"
    pretrained: ClassVar[Pretrained | None] = None
    kept: ClassVar[tuple[str, ...]] = ()

    def key(self, at: LakeReader) -> str | None:
        """sha256 over all that shapes a model but the clips it is trained on; None where it hangs on another model
        that is not made yet."""
        return config_hash(self.name, self.version, getattr(at.config, self.table))

    def settings(self, config: LakeConfig) -> Mapping[str, Any]:
        """What `models` keeps of the configuration."""
        return asdict(getattr(config, self.table))

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
        return self.pretrained is not None and self.pretrained.fits(getattr(config, self.table))

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
    def train(self, lake: Lake, config: LakeConfig, data: Data, file: str, progress: Steps) -> Mapping[str, Any]:
        """Train, save as `file` of the lake; returns the metrics. A training that was interrupted goes on.

        `data_sha256` among the metrics says what it was trained on, by default the whole lake.

        Raises:
            UserError: there is too little to train on.
        """

    def metrics_of(self, weights: Path) -> Mapping[str, Any]:
        """The metrics that a file of weights holds. Raises `ValueError` if it holds something else."""
        raise NotImplementedError

    def take(self, lake: Lake, config: LakeConfig, weights: Path, file: str) -> Mapping[str, Any]:
        """Copy pretrained weights into the lake as `file`; returns the metrics of their training.

        Raises:
            ValueError: they do not fit the configuration.
        """
        return copy_weights(lake, weights, file, self.metrics_of(weights), *self.kept)

    def hints(self, config: LakeConfig, metrics: Mapping[str, Any]) -> list[str]:
        """What a person should know of a model that was just trained."""
        return []

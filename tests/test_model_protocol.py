"""What every kind of model keeps to, whatever it learns."""

from __future__ import annotations

import inspect
import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.deep_motifs.config import NetworkConfig
from motionlake.deephums.config import DescriptorsConfig, SubmotionConfig
from motionlake.errors import UserError
from motionlake.glogen.config import SynthesisConfig
from motionlake.lake.config import LakeConfig, load_config
from motionlake.lake.layout import Lake, open_lake
from motionlake.stages.model_kind import ModelKind, Selection
from motionlake.stages.reader import lake_reader
from motionlake.stages.registry import KINDS
from motionlake.weights import read_tensors, save_tensors

Kind = ModelKind[Any]
# Trainings that are long enough to leave a checkpoint after EVERY steps; other kinds are fitted at one stroke.
SHORT: dict[str, Any] = {
    "network": NetworkConfig(architecture="conv", weights="own", steps=5, max_words=64),
    "descriptors": DescriptorsConfig(weights="own", epochs=3),
    "submotion": SubmotionConfig(weights="own", steps=5, batch=4, hidden=16),
    "synthesis": SynthesisConfig(recipe="networks", weights="own", epochs=3),
}
EVERY = 2
TRAININGS = (
    "deep_motifs.words.training",
    "deephums.training",
    "deephums.submotions",
    "glogen.training",
    "glogen.inbetweening",
)
PRETRAINED = [kind for kind in KINDS.values() if kind.pretrained is not None]


class KilledError(Exception):
    """Stands for a kill between two steps."""


def named(kind: Kind) -> str:
    return kind.name


def training(lake: Path, kind: Kind) -> tuple[Lake, LakeConfig, Any]:
    """A lake, a configuration of a short training, and what is trained on."""
    target = open_lake(lake)
    config = load_config(target.config_file)
    if kind.name in SHORT:
        config = config.replacing(SHORT[kind.name])
    with lake_reader(target, config) as at:
        return target, config, kind.data(at, Selection())


@pytest.mark.parametrize("kind", KINDS.values(), ids=named)
def test_a_training_repeats_and_goes_on_where_it_was_killed(
    kind: Kind, built_lake: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in TRAININGS:
        monkeypatch.setattr(f"motionlake.{name}.CHECKPOINT_EVERY", EVERY)
        monkeypatch.setattr(f"motionlake.{name}.REPORT_EVERY", EVERY, raising=False)
    lake, config, data = training(built_lake, kind)
    assert data is not None

    def fit(name: str, progress: Any = lambda *_: None) -> Path:
        (tmp_path / name).mkdir(exist_ok=True)
        trained = kind.fit(lake, config, data, tmp_path / name / "checkpoint.safetensors", progress)
        assert list((tmp_path / name).iterdir()) == [], "the checkpoint goes with the training"
        assert json.loads(json.dumps(dict(trained.metrics))) == dict(trained.metrics), "JSON values"
        file = tmp_path / f"{name}{kind.suffix}"
        trained.save(file)
        return file

    whole = fit("whole")
    assert fit("again").read_bytes() == whole.read_bytes()
    loaded = kind.load(whole)
    loaded.save(tmp_path / "saved")
    assert (tmp_path / "saved").read_bytes() == whole.read_bytes(), "a file holds all of a model"
    assert kind.hints(config, loaded.metrics) is not None

    def kill(done: int, steps: int, loss: float) -> None:
        if done < steps and any((tmp_path / "killed").iterdir()):
            raise KilledError

    if kind.name in SHORT:
        with pytest.raises(KilledError):
            fit("killed", kill)
        assert fit("killed").read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("kind", KINDS.values(), ids=named)
def test_a_model_becomes_a_file_of_the_lake(kind: Kind, lake: Path) -> None:
    target, config, data = training(lake, kind)
    if kind.name in SHORT:
        config = config.replacing(
            replace(SHORT[kind.name], **{"steps" if hasattr(SHORT[kind.name], "steps") else "epochs": 1})
        )
    metrics = kind.train(target, config, data, f"models/made{kind.suffix}", lambda *_: None)
    assert kind.load(target.path(f"models/made{kind.suffix}")).metrics.items() <= metrics.items()
    if kind.said:
        assert "mylake" in kind.said.format(lake="mylake", **metrics)


@pytest.mark.parametrize("kind", KINDS.values(), ids=named)
def test_a_file_of_something_else_is_refused(kind: Kind, built_lake: Path, tmp_path: Path) -> None:
    other = next(other for other in PRETRAINED if other is not kind)
    assert other.pretrained is not None
    with pytest.raises(ValueError, match=r"\S"):
        kind.load(other.pretrained.file)
    (tmp_path / "damaged").write_bytes(b"\x10\0\0\0\0\0\0\0not a header")
    with pytest.raises(ValueError, match=r"\S"):
        kind.load(tmp_path / "damaged")


@pytest.mark.parametrize("kind", PRETRAINED, ids=named)
def test_pretrained_weights_are_those_that_their_description_names(kind: Kind, tmp_path: Path) -> None:
    assert kind.pretrained is not None
    about, metrics = kind.pretrained.about(), kind.load(kind.pretrained.file).metrics
    assert kind.fits(LakeConfig()) or kind.name == "synthesis"
    assert not kind.fits(LakeConfig().replacing(kind.config(weights="own")))
    assert {"sets", "data_sha256", *kind.kept} <= metrics.keys() | {"split", "dataset"}
    assert about["sets"] == metrics["sets"]
    lake = Lake(tmp_path)
    kept = kind.take(lake, LakeConfig(), kind.pretrained.file, "models/taken.safetensors")
    assert (tmp_path / "models/taken.safetensors").read_bytes() == kind.pretrained.file.read_bytes()
    assert kept["pretrained"] is True
    assert kept["data_sha256"] == metrics["data_sha256"]


@pytest.mark.parametrize("kind", KINDS.values(), ids=named)
def test_a_kind_says_what_it_would_make_and_what_is_missing(kind: Kind, built_lake: Path, tmp_path: Path) -> None:
    target = open_lake(built_lake)
    with lake_reader(target, load_config(target.config_file)) as at:
        assert kind.announce(at).startswith("will ")
        settings, key = kind.settings(at.config), kind.key(at)
        assert json.loads(json.dumps(settings)) == settings
        assert key is not None
        assert kind.key(at) == key
        changed = at.config.replacing(kind.config(**{first_number(kind): 3}))
    with lake_reader(target, changed) as at:
        assert kind.key(at) != key
    if kind.command:
        assert "Example: motionlake train " in inspect.cleandoc(kind.help)
        known = {field.name for field in (*fields(Selection), *fields(kind.config))}
        assert set(kind.options) <= known


def first_number(kind: Kind) -> str:
    return next(field.name for field in fields(kind.config) if type(field.default) is int)


@pytest.mark.parametrize("kind", KINDS.values(), ids=named)
def test_an_empty_lake_has_nothing_to_train_on(kind: Kind, tmp_path: Path) -> None:
    from tests.lakes import motionlake

    assert motionlake("init", tmp_path / "lake").status == 0
    target = open_lake(tmp_path / "lake")
    with lake_reader(target, LakeConfig()) as at:
        if kind.name == "neighbours":
            with pytest.raises(UserError, match=str(target.root)):
                kind.data(at, Selection())
        else:
            assert kind.data(at, Selection()) is None


def test_arrays_keep_their_shapes_in_files(tmp_path: Path) -> None:
    """Of any number of dimensions, none included."""
    given = {"scalar": np.array(3.0), "turned": np.arange(6.0).reshape(2, 3).T, "row": np.arange(3.0)}
    save_tensors(tmp_path / "arrays", given, "arrays", {"n": 1})
    found, kept = read_tensors(tmp_path / "arrays", "arrays")
    assert kept == {"n": 1}
    for name, value in given.items():
        assert found[name].shape == value.shape
        np.testing.assert_array_equal(found[name], value)

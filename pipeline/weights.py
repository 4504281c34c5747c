"""Files of models, safetensors with what they need beside the tensors, and weights that are installed with the code."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray


def save_tensors(path: Path, tensors: Mapping[str, NDArray[Any]], key: str, kept: Mapping[str, Any]) -> None:
    """Write arrays by name, and `kept` (JSON values) under a key of the file's metadata."""
    from safetensors.numpy import save_file

    whole = {name: np.asarray(value, order="C") for name, value in tensors.items()}
    path.touch()
    mode = path.stat().st_mode
    save_file(whole, path, metadata={key: json.dumps(kept, sort_keys=True)})
    path.chmod(mode)  # safetensors lets nobody else read it


def read_tensors(path: Path, key: str, *names: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """What `save_tensors` wrote: arrays by name (default: all of them), and `kept`.

    Raises:
        ValueError: the file is damaged, or has no such key.
    """
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="numpy") as file:
            metadata = (file.metadata() or {}).get(key)
            if metadata is None:
                raise ValueError(f"{path} holds no {key.replace('_', ' ')}")
            return {name: file.get_tensor(name) for name in names or file.keys()}, json.loads(metadata)
    except SafetensorError as error:
        raise ValueError(f"{path} is damaged: {error}") from error


def holds(path: Path, key: str) -> bool:
    """Whether a file's metadata has such a key.

    Raises:
        ValueError: the file is damaged.
    """
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="numpy") as file:
            return key in (file.metadata() or {})
    except SafetensorError as error:
        raise ValueError(f"{path} is damaged: {error}") from error


STATE_KEY: Final = "training"  # of the metadata of checkpoints
_DIGEST: Final = "sha256"  # likewise: of the state and of all tensors


def checkpoint_metadata(tensors: Mapping[str, NDArray[Any]], state: str) -> dict[str, str]:
    """What a checkpoint says beside its tensors: the state of the training, and a digest of all of it."""
    return {STATE_KEY: state, _DIGEST: _digest(tensors, state)}


def _digest(tensors: Mapping[str, NDArray[Any]], state: str) -> str:
    digest = hashlib.sha256(state.encode())
    for name in sorted(tensors):
        value = np.asarray(tensors[name], order="C")
        digest.update(f"{name} {value.dtype} {value.shape}".encode() + value.tobytes())
    return digest.hexdigest()


def checkpoint_fault(path: Path) -> str | None:
    """What is wrong with a checkpoint; None where it is as it was written."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="numpy") as file:
            said = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, ValueError, OverflowError) as error:
        return f"is damaged ({str(error).splitlines()[0]})"
    whole = said.get(_DIGEST) == _digest(tensors, said.get(STATE_KEY, "")) and set(said) == {STATE_KEY, _DIGEST}
    return None if whole else "holds other bytes than were written"


@dataclass
class Pretrained:
    """One file of weights, and the JSON file of the same name that describes their training.

    Attributes:
        file: the safetensors file.
        matches: whether weights of this description are what the given configurations ask for.
    """

    file: Path
    matches: Callable[..., bool]

    def about(self) -> dict[str, Any]:
        """The description: configuration, data sets, sha256 of the clips; empty where a file is missing."""
        return _description(self.file)

    def fits(self, *configs: Any) -> bool:
        """Whether a lake of this configuration starts with these weights instead of training its own."""
        about: Mapping[str, Any] = self.about()
        return bool(about) and self.matches(about, *configs)


@cache
def _description(weights: Path) -> dict[str, Any]:
    beside = weights.with_suffix(".json")
    if not (weights.is_file() and beside.is_file()):
        return {}
    content: dict[str, Any] = json.loads(beside.read_text(encoding="utf-8"))
    return content

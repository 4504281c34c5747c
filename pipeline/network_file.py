"""Networks as single safetensors files: weights, and beside them in JSON what else makes the network."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn


def save_network(path: Path, network: nn.Module, key: str, kept: Mapping[str, Any]) -> None:
    """Write the weights, and `kept` (JSON values) under a key of the file's metadata."""
    tensors = {name: value.contiguous() for name, value in network.state_dict().items()}
    save_file(tensors, path, metadata={key: json.dumps(kept, sort_keys=True)})


def read_network(path: Path, key: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """What `save_network` wrote: weights by name, and `kept`.

    Raises:
        ValueError: the file is damaged, or has no such key.
    """
    try:
        with safe_open(path, framework="pt") as file:
            metadata = (file.metadata() or {}).get(key)
            if metadata is None:
                raise ValueError(f"{path} holds no {key.replace('_', ' ')}")
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except SafetensorError as error:
        raise ValueError(f"{path} is damaged: {error}") from error
    return tensors, json.loads(metadata)

"""Checkpoints of training: weights, optimiser, random state and losses in one safetensors file; nothing is pickled."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

STATE_KEY: Final = "training"


class Checkpoint:
    """The state of one training in a file; `settings` (dataclasses) and `data` say which training it is."""

    def __init__(self, path: Path, data: NDArray[np.float32], *settings: Any) -> None:
        digest = hashlib.sha256(json.dumps([asdict(s) for s in settings], sort_keys=True).encode())
        digest.update(np.ascontiguousarray(data).tobytes())
        self._path = path
        self._key = digest.hexdigest()

    def resume(self, network: nn.Module, optimiser: torch.optim.Optimizer, rng: np.random.Generator) -> list[float]:
        """Bring everything to where the file left it; returns the losses so far.

        A file that is of another training (other data or settings), or none, leaves everything as it is.
        """
        if not self._path.is_file():
            return []
        with safe_open(self._path, framework="pt") as file:
            state = json.loads((file.metadata() or {}).get(STATE_KEY, "{}"))
            if state.get("key") != self._key:
                return []
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        network.load_state_dict({n.removeprefix("network."): t for n, t in tensors.items() if n.startswith("network.")})
        kept: dict[int, dict[str, Tensor]] = {}
        for name, tensor in tensors.items():
            if name.startswith("optimiser."):
                _, index, key = name.split(".", 2)
                kept.setdefault(int(index), {})[key] = tensor
        optimiser.load_state_dict({**optimiser.state_dict(), "state": kept})
        rng.bit_generator.state = state["random"]
        return [float(loss) for loss in tensors["losses"]]

    def save(
        self, network: nn.Module, optimiser: torch.optim.Optimizer, rng: np.random.Generator, losses: list[float]
    ) -> None:
        """Write the state, whole or not at all."""
        tensors = {f"network.{name}": value.contiguous() for name, value in network.state_dict().items()}
        for index, entries in optimiser.state_dict()["state"].items():
            tensors |= {f"optimiser.{index}.{key}": value.contiguous() for key, value in entries.items()}
        tensors["losses"] = torch.tensor(losses, dtype=torch.float64)
        state = {"key": self._key, "random": rng.bit_generator.state}
        temporary = self._path.with_name(f".{self._path.name}.tmp")
        save_file(tensors, temporary, metadata={STATE_KEY: json.dumps(state)})
        temporary.replace(self._path)

    def remove(self) -> None:
        """Delete the file of a training that has ended."""
        self._path.unlink(missing_ok=True)

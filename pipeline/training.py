"""What every training shares: the loop with its checkpoint and progress, files of networks, and threads."""

from __future__ import annotations

import hashlib
import json
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal, Protocol

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.stopping import asked, held
from motionlake.threads import limited
from motionlake.weights import STATE_KEY, checkpoint_fault, checkpoint_metadata, read_tensors, save_tensors
from safetensors import safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

STEEPEST: Final = 1.0  # norm that gradients are cut to
MOMENTUM: Final = 0.99  # with .9 the thesis's networks need three times as many epochs
REPORTED: Final = 10.0  # seconds after which a step is reported, however few steps were done


@contextmanager
def on_threads(count: int) -> Iterator[None]:
    """So many threads for torch and for numpy's linear algebra."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        with limited(count):
            yield
    finally:
        torch.set_num_threads(before)


def save_network(path: Path, network: nn.Module, key: str, kept: Mapping[str, Any]) -> None:
    """Write the weights, and `kept` (JSON values) under a key of the file's metadata."""
    save_tensors(path, {name: value.numpy() for name, value in network.state_dict().items()}, key, kept)


def read_network(path: Path, key: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """What `save_network` wrote: weights by name, and `kept`. Raises `ValueError` as `read_tensors` does."""
    arrays, kept = read_tensors(path, key)
    return {name: torch.from_numpy(value) for name, value in arrays.items()}, kept


class Checkpoint:
    """The state of one training in a file; `settings` (dataclasses) and `data` say which training it is."""

    def __init__(self, path: Path, data: Float32Array, *settings: Any) -> None:
        digest = hashlib.sha256(json.dumps([asdict(s) for s in settings], sort_keys=True).encode())
        digest.update(np.ascontiguousarray(data).tobytes())
        self._path = path
        self._key = digest.hexdigest()

    def resume(self, network: nn.Module, optimiser: torch.optim.Optimizer, rng: np.random.Generator) -> list[float]:
        """Bring everything to where the file left it; returns the losses so far.

        A file that is of another training (other data or settings), a damaged one, or none leaves everything as it is.
        """
        if not self._path.is_file():
            return []
        fault = checkpoint_fault(self._path)
        if fault is not None:
            warnings.warn(f"{self._path}: {fault}; the training begins anew", stacklevel=2)
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
        tensors = {f"network.{name}": value.cpu().contiguous() for name, value in network.state_dict().items()}
        for index, entries in optimiser.state_dict()["state"].items():
            tensors |= {f"optimiser.{index}.{key}": value.cpu().contiguous() for key, value in entries.items()}
        tensors["losses"] = torch.tensor(losses, dtype=torch.float64)
        state = {"key": self._key, "random": rng.bit_generator.state}
        temporary = self._path.with_name(f".{self._path.name}.tmp")
        arrays = {name: value.numpy() for name, value in tensors.items()}
        save_file(tensors, temporary, metadata=checkpoint_metadata(arrays, json.dumps(state)))
        temporary.replace(self._path)

    def remove(self) -> None:
        """Delete the file of a training that has ended."""
        self._path.unlink(missing_ok=True)


@dataclass(frozen=True)
class Loop:
    """Steps of a training that goes on from its checkpoint where it was interrupted; a signal waits for the step.

    Attributes:
        network, optimiser, rng: what the checkpoint keeps.
        steps: how many.
        step: does the step of a number from 0; returns its loss.
        checkpoint: a file that keeps the training, deleted at the end.
        every: steps from one checkpoint to the next.
        progress: called with (steps done, steps, loss).
        told: steps from one such call to the next, fewer where steps are slow.
        stays: the file stays at the end, for a training of several networks that is interrupted at a later one.
        over: asked before each step whether the training has ended already.
    """

    network: nn.Module
    optimiser: torch.optim.Optimizer
    rng: np.random.Generator
    steps: int
    step: Callable[[int], float]
    checkpoint: Checkpoint | None = None
    every: int = 100
    progress: Progress | None = None
    told: int = 1
    stays: bool = False
    over: Callable[[], bool] = lambda: False

    def run(self) -> list[float]:
        """Train to the end; returns the loss of each step, those before a resumption too."""
        kept = self.checkpoint
        losses = kept.resume(self.network, self.optimiser, self.rng) if kept else []
        spoke = time.monotonic()
        for step in range(len(losses), self.steps):
            if self.over():
                break
            done = step + 1
            with held() if kept else nullcontext():
                losses.append(self.step(step))
                if kept and (done % self.every == 0 or (self.stays and done == self.steps) or asked()):
                    kept.save(self.network, self.optimiser, self.rng, losses)
            slow = time.monotonic() - spoke >= REPORTED
            if self.progress is not None and (done % self.told == 0 or done == self.steps or slow):
                spoke = time.monotonic()
                self.progress(done, self.steps, losses[-1])
        if kept and not self.stays:
            kept.remove()
        return losses


@dataclass(frozen=True)
class Training:
    """What is trained, and how.

    Attributes:
        network: in training mode from the first epoch on.
        optimiser: of its parameters.
        epochs: how many.
        rate: learning rate when a share (0 to 1) of the training is done.
        batches: of an epoch, the examples of each, drawn anew.
        loss: of the examples of a batch.
        seed: of torch's chance in each epoch, so that it is the same after a resumption.
        rng: that `batches` and `loss` draw from.
        checkpoint: a file that keeps the training, deleted at the end.
        every: epochs from one checkpoint to the next.
        stays: the file stays at the end, for a training of several networks that is interrupted at a later one.
        progress: called with (epochs done, epochs, mean loss).
        after: called with the epochs done, before `progress`.
    """

    network: nn.Module
    optimiser: torch.optim.Optimizer
    epochs: int
    rate: Callable[[float], float]
    batches: Callable[[], Sequence[Int64Array]]
    loss: Callable[[Int64Array], Tensor]
    seed: int
    rng: np.random.Generator
    checkpoint: Checkpoint | None = None
    every: int = 10
    progress: Progress | None = None
    after: Callable[[int], None] | None = None
    stays: bool = False

    def run(self) -> list[float]:
        """Train to the end; returns the mean loss of each epoch, those before a resumption too."""
        self.network.train()

        def epoch(number: int) -> float:
            torch.manual_seed(self.seed * 100_003 + number)
            return self._epoch(number)

        return Loop(
            self.network, self.optimiser, self.rng, self.epochs, epoch, self.checkpoint, self.every, self._told,
            stays=self.stays,
        ).run()  # fmt: skip

    def _told(self, done: int, epochs: int, loss: float) -> None:
        if self.after is not None:
            self.after(done)
        if self.progress is not None:
            self.progress(done, epochs, loss)

    def _epoch(self, epoch: int) -> float:
        batches = self.batches()
        total = 0.0
        for step, rows in enumerate(batches):
            for group in self.optimiser.param_groups:
                group["lr"] = self.rate((epoch + step / len(batches)) / self.epochs)
            self.optimiser.zero_grad(set_to_none=True)
            loss = self.loss(rows)
            loss.backward()  # type: ignore[no-untyped-call]
            nn.utils.clip_grad_norm_(self.network.parameters(), STEEPEST)
            self.optimiser.step()
            total += float(loss.detach())
        return total / len(batches)


class Rates(Protocol):
    """What a recipe says of its optimiser."""

    @property
    def optimiser(self) -> Literal["adam", "sgd", "momentum"]: ...
    @property
    def learning_rate(self) -> float: ...
    @property
    def weight_decay(self) -> float: ...


def optimiser_of(network: nn.Module, recipe: Rates) -> torch.optim.Optimizer:
    """AdamW; by name plain descent, as a thesis has it, or descent with momentum."""
    if recipe.optimiser != "adam":
        momentum = MOMENTUM if recipe.optimiser == "momentum" else 0.0
        return torch.optim.SGD(network.parameters(), lr=recipe.learning_rate, momentum=momentum)
    return torch.optim.AdamW(network.parameters(), lr=recipe.learning_rate, weight_decay=recipe.weight_decay)


def rate_of(recipe: Rates) -> Callable[[float], float]:
    """The learning rate at a share of the training: down to nothing by a cosine; that of descent stays."""
    if recipe.optimiser != "adam":
        return lambda share: recipe.learning_rate
    return lambda share: recipe.learning_rate * 0.5 * (1 + float(np.cos(np.pi * share)))

"""The sub-motion encoder: it maps a piece of a motion near the clip that the piece is part of (DeepHuMS, 3.3.5).

Two recipes. "deephums" is the thesis's: a recurrent network is trained so that what it makes of a piece equals (L2)
the descriptor of the whole clip, made by the first network, which stays as it is. "default" reads pieces and whole
clips with one network, which takes the maximum over frames of what it sees around each, and learns by contrast: of all
clips of a batch, the one that a piece was cut from should be the nearest. A piece then keeps what its clip shares with
no other; descriptors trained to forget who moves, and when, do not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.deephums.batches import NO_AUGMENTATION, padded, part_of
from motionlake.deephums.config import DIMENSION, LONGEST, SHORTEST, SUBMOTION_KEY, SubmotionConfig
from motionlake.deephums.encoders import CHANNELS, Lstm, motion_of
from motionlake.deephums.piece_encoder import SCALE, SMALLEST, greatest
from motionlake.deephums.sequence import BONES, one_cycle
from motionlake.motion.skeleton import COMMON
from motionlake.training import Checkpoint, Loop, on_threads, read_network, save_network
from torch import Tensor, nn
from torch.nn.functional import cross_entropy, gelu, mse_loss, normalize

CHECKPOINT_EVERY: Final = 100
MINE_EVERY: Final = 25
NEAR: Final = 3
REPORT_EVERY: Final = 10
TOGETHER: Final = 32  # windows that the network sees at once
# Body and stance vary between the clips of a batch, so that people are told apart who were never seen.
BODIES: Final = replace(NO_AUGMENTATION, yaw=0.15, tilt=0.05, scale=0.05, offset=0.02)
# The filter makes the ends of a piece a little other than the same frames inside its clip.
VIEWS: Final = replace(NO_AUGMENTATION, noise=0.002)


class FramePooling(nn.Module):
    """What is seen around each frame, its maximum over frames: what a piece holds, its clip holds too."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.around = nn.Conv1d(CHANNELS, hidden, 5, padding=2)
        self.first, self.second = nn.LayerNorm(hidden), nn.LayerNorm(2 * hidden)
        self.widen = nn.Linear(hidden, 2 * hidden)
        self.project = nn.Linear(2 * hidden, DIMENSION, bias=False)

    def forward(self, clips: Tensor, lengths: Tensor) -> Tensor:
        """[B, 512] of clips [B, T, 15, 3], of which the first `lengths` [B] frames count."""
        counts = torch.arange(clips.shape[1], device=clips.device)[None] < lengths[:, None]
        frames = self.frames(frame_by_frame(clips) * counts[..., None])
        return self.project(frames.masked_fill(~counts[..., None], -torch.inf).amax(dim=1))  # type: ignore[no-any-return]

    def frames(self, seen: Tensor) -> Tensor:
        """[B, T, 2 hidden] what is seen around each frame of `frame_by_frame`."""
        frames = gelu(self.first(self.around(seen.transpose(1, 2)).transpose(1, 2)))
        return gelu(self.second(self.widen(frames)))


def frame_by_frame(clips: Tensor) -> Tensor:
    """[B, T, 90] joints by facing and size of each frame, and their motion to the next, of clips [B, T, 15, 3].

    So a frame looks the same in a piece and in its clip, of which facing and size as a whole differ. Of the root only
    its motion is kept.
    """
    clips = clips / _sizes(clips)
    left, right = ([COMMON.index(f"{side}_{joint}") for joint in ("hip", "shoulder")] for side in ("left", "right"))
    across = normalize(clips[:, :, left] - clips[:, :, right], dim=3).sum(dim=2)
    flat = normalize(across[..., [0, 2]] + 1e-6, dim=2)
    cos, sin = flat[..., :1], -flat[..., 1:]

    def turned(values: Tensor) -> Tensor:
        x, y, z = values.unbind(dim=-1)
        return torch.stack([x * cos - z * sin, y, x * sin + z * cos], dim=-1)

    body = torch.cat([torch.zeros_like(clips[:, :, :1]), turned(clips[:, :, 1:])], dim=2)
    motion = torch.cat([turned(motion_of(clips[:, :, :1])), motion_of(body[:, :, 1:])], dim=2)
    return torch.cat([body.flatten(2), motion.flatten(2)], dim=2) * SCALE


def _sizes(clips: Tensor) -> Tensor:
    """[B, T, 1, 1] lengths of all bones of a frame, over what they are in an average body."""
    ends = [[COMMON.index(name) for name in bone] for bone in BONES]
    at_root = torch.cat([torch.zeros_like(clips[:, :, :1]), clips[:, :, 1:]], dim=2)
    bones = at_root[:, :, [a for a, _ in ends]] - at_root[:, :, [b for _, b in ends]]
    return (bones.norm(dim=3).sum(dim=2) / sum(BONES.values())).clamp(min=SMALLEST)[..., None, None]  # type: ignore[no-any-return]


def network_of(config: SubmotionConfig) -> nn.Module:
    """An untrained network."""
    return FramePooling(config.hidden) if config.recipe == "default" else Lstm(config.hidden, DIMENSION)


def train_submotion(
    sequences: Sequence[Float32Array],
    config: SubmotionConfig,
    *,
    targets: Float32Array | None = None,
    checkpoint: Path | None = None,
    device: str | None = None,
    progress: Progress | None = None,
) -> tuple[nn.Module, list[float]]:
    """Train the sub-motion encoder on pieces of clips.

    Args:
        sequences: n clips (`clip_sequence`), two at least.
        config: recipe, sizes and seed.
        targets: [n, 512] descriptors of the clips by the first network; for recipe "deephums".
        checkpoint: a file to save training to and to go on from; deleted at the end.
        device: of the computation; CUDA where there is one, else the CPU.
        progress: called with (steps done, steps, loss) every so often.

    Returns:
        The network in evaluation mode on the CPU, and the loss of each step; the same for the same input,
        configuration and seed (on CUDA: up to rounding).

    Raises:
        ValueError: fewer than two clips, or recipe "deephums" without targets.
    """
    if len(sequences) < 2:
        raise ValueError(f"{len(sequences)} clips are too few to train on")
    if (config.recipe == "deephums") != (targets is not None):
        raise ValueError('recipe "deephums", and no other, needs the descriptors of the clips')
    device = device or ("cuda" if torch.cuda.is_available() else "cpu")
    rng = np.random.default_rng(config.seed)
    with on_threads(1), torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        network = network_of(config).to(device).train()
        optimiser = torch.optim.AdamW(network.parameters(), lr=config.learning_rate, weight_decay=0.01)
        data = np.concatenate([sequence.ravel() for sequence in sequences])
        kept = Checkpoint(checkpoint, data, config) if checkpoint else None
        near: Int64Array | None = None

        def train(step: int) -> float:
            nonlocal near
            if step and step % MINE_EVERY == 0:
                near = _nearest(network, sequences, config, device)
            for group in optimiser.param_groups:
                group["lr"] = config.learning_rate * one_cycle(step / config.steps)
            optimiser.zero_grad(set_to_none=True)
            loss = _loss(network, sequences, targets, _rows(len(sequences), near, config, rng), config, rng, device)
            loss.backward()  # type: ignore[no-untyped-call]
            nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
            return float(loss.detach())

        losses = Loop(
            network, optimiser, rng, config.steps, train, kept, CHECKPOINT_EVERY, progress, REPORT_EVERY
        ).run()
    return network.cpu().eval(), losses


def _loss(
    network: nn.Module,
    sequences: Sequence[Float32Array],
    targets: Float32Array | None,
    rows: Int64Array,
    config: SubmotionConfig,
    rng: np.random.Generator,
    device: str,
) -> Tensor:
    wholes = [_window(sequences[i], rng) for i in rows]
    if targets is not None:
        pieces, lengths = padded([_piece(whole, config, rng) for whole in wholes])
        return mse_loss(network(pieces.to(device), lengths.to(device)), torch.from_numpy(targets[rows]).to(device))
    clips, lengths = padded([whole for whole in wholes for _ in range(config.variants)])
    bodies = BODIES(clips, rng)
    cut = [_piece(body[:n].numpy(), config, rng) for body, n in zip(bodies, lengths.tolist(), strict=True)]
    pieces, shorter = padded(cut)
    found = normalize(network(VIEWS(pieces, rng).to(device), shorter.to(device)), dim=1)
    whole = normalize(network(bodies.to(device), lengths.to(device)), dim=1)
    return cross_entropy(found @ whole.T / config.temperature, torch.arange(len(whole), device=device))


@torch.no_grad()
def _nearest(
    network: nn.Module, sequences: Sequence[Float32Array], config: SubmotionConfig, device: str
) -> Int64Array | None:
    """[n, 3] the clips that the network finds nearest to each so far: what a batch is hard with."""
    if config.recipe == "deephums" or len(sequences) <= NEAR:
        return None
    found = []
    for start in range(0, len(sequences), config.batch):
        clips, lengths = padded([clip[:LONGEST] for clip in sequences[start : start + config.batch]])
        found.append(normalize(network(clips.to(device), lengths.to(device)), dim=1))
    cosines = torch.cat(found) @ torch.cat(found).T
    cosines.fill_diagonal_(-1)
    return cosines.topk(NEAR, dim=1).indices.cpu().numpy()


def _rows(count: int, near: Int64Array | None, config: SubmotionConfig, rng: np.random.Generator) -> Int64Array:
    """The clips of a batch: drawn at random, or some of them and those that are near to each."""
    if near is None:
        return rng.permutation(count)[: config.batch]
    some = rng.permutation(count)[: max(1, config.batch // (NEAR + 1))]
    return np.unique(np.concatenate([some, near[some].ravel()]))


def _window(clip: Float32Array, rng: np.random.Generator) -> Float32Array:
    return part_of(clip, int(rng.integers(0, max(1, len(clip) - LONGEST + 1))), LONGEST)


def _piece(clip: Float32Array, config: SubmotionConfig, rng: np.random.Generator) -> Float32Array:
    count = max(SHORTEST, round(len(clip) * rng.uniform(config.shortest, config.longest)))
    return part_of(clip, int(rng.integers(0, max(1, len(clip) - count + 1))), count)


@dataclass(frozen=True)
class TrainedSubmotion:
    """A frozen network.

    Attributes:
        config: how it was trained.
        network: in evaluation mode, on the CPU.
        metrics: of its training.
    """

    config: SubmotionConfig
    network: nn.Module
    metrics: Mapping[str, Any]

    def embed(self, sequences: Sequence[Float32Array]) -> Float32Array:
        """[n, 512] vectors, of length one, of n pieces or windows (`clip_sequence`).

        Those of one length go through the network together, so that each is what it is alone but for rounding.
        """
        found = np.empty((len(sequences), DIMENSION), dtype=np.float32)
        places: dict[int, list[int]] = {}
        for at, sequence in enumerate(sequences):
            places.setdefault(len(sequence), []).append(at)
        with on_threads(1), torch.inference_mode():
            for alike in places.values():
                for start in range(0, len(alike), TOGETHER):
                    some = alike[start : start + TOGETHER]
                    found[some] = normalize(self.network(*padded([sequences[at] for at in some])), dim=1).numpy()
        return found

    def embed_windows(self, sequence: Float32Array, windows: Int64Array) -> Float32Array:
        """[n, 512] vectors, of length one, of the windows [n, 2] of one clip (`clip_sequence`), each [first, last).

        Recipe "default" sees every frame once, however many windows hold it: at its ends a window sees two frames of
        the clip beyond them, which a piece cut from it does not have.
        """
        if not isinstance(self.network, FramePooling):
            return self.embed([sequence[first:last] for first, last in windows.tolist()])
        with on_threads(1), torch.inference_mode():
            frames = self.network.frames(frame_by_frame(torch.from_numpy(sequence)[None]))[0].numpy()
            return normalize(self.network.project(torch.from_numpy(greatest(frames, windows))), dim=1).numpy()

    def save(self, path: Path) -> None:
        """Write it as one safetensors file."""
        kept = {"config": asdict(self.config), "figures": dict(self.metrics)}
        save_network(path, self.network, SUBMOTION_KEY, kept)


def load_submotion(path: Path) -> TrainedSubmotion:
    """Read what `TrainedSubmotion.save` wrote.

    Raises:
        ValueError: the file holds something else.
    """
    tensors, kept = read_network(path, SUBMOTION_KEY)
    config = SubmotionConfig(**kept["config"])
    network = network_of(config)
    network.load_state_dict(tensors)
    return TrainedSubmotion(config, network.eval(), kept["figures"])

"""A trained generator: from requests to motion, sparse poses first, dense frames then (section 4.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Float64Array
from motionlake.glogen.config import SEEDS, GloGenRecipe, LocGenRecipe, OnsetRecipe, SynthesisConfig
from motionlake.glogen.inbetweening import DenseDecoder, Inbetweener, dense_motions, locgen_network
from motionlake.glogen.keyed import keyed_motion
from motionlake.glogen.network import glogen_network
from motionlake.glogen.onset import Onset, with_onset
from motionlake.glogen.onset_examples import FEATURES, state_at
from motionlake.glogen.onset_network import OnsetNetwork
from motionlake.glogen.rollout import Rollout, roll_out
from motionlake.glogen.sparse import WIDTH, even_motion, ranges, sparse_motion
from motionlake.glogen.training import ByClass
from motionlake.glogen.trajectories import FPS, body_motion, in_world, measured_length
from motionlake.motion.calibration import recorded_range
from motionlake.motion.generation import SHORTEST, GeneratedMotion, MotionRequest, SeedClip
from motionlake.motion.skeleton import JOINTS, body_length, facing
from motionlake.training import on_threads, read_network, save_network
from torch import nn

METADATA_KEY: Final = "motion_generator"


@dataclass(frozen=True)
class StartState:
    """The poses and the place that a generated motion continues from.

    Attributes:
        rows: [5, 65] sparse poses.
        state: [245] pose and velocities at the last of them (`onset_examples.state_at`).
        root: [3] hips in the last pose, metres; y is that of the ground.
        yaw: heading of the last pose, radians.
        first, last: frames [first, last) of the clip, at its own rate, that the poses are from.
    """

    rows: Float64Array
    state: Float64Array
    root: Float64Array
    yaw: float
    first: int
    last: int


def start_state(seed: SeedClip, chance: int, sparse: int, cyclic: bool = False) -> StartState:
    """The first sparse poses of a seed clip, or of one piece of a long clip, without calibration poses at its ends.

    Args:
        seed: the clip.
        chance: seed that picks the piece of a long clip.
        sparse: number of sparse poses that represent a motion.
        cyclic: whether the class is cyclic; its sparse poses are then evenly spaced in time (`even_motion`).

    Raises:
        ValueError: the clip is shorter than needed, or of another skeleton.
    """
    if seed.positions.ndim != 3 or seed.positions.shape[1:] != (len(JOINTS), 3):
        shape = "x".join(map(str, seed.positions.shape[1:]))
        raise ValueError(f"{seed.clip} is of another skeleton: {shape} numbers a frame, not {len(JOINTS)}x3")
    begin, end = recorded_range(seed.positions, seed.fps)
    positions = seed.positions[begin:end]
    frames = round((len(positions) - 1) / seed.fps * FPS) + 1 if len(positions) else 0
    if frames < SHORTEST:
        cut = " without its calibration poses" * (len(positions) < len(seed.positions))
        seconds = f"{len(positions) / seed.fps:.2f} s{cut}"
        raise ValueError(f"{seed.clip} lasts {seconds}; to start from it needs {SHORTEST / FPS:.2f} s at least")
    if body_length(seed.rest_offsets) < 1e-6:
        raise ValueError(f"{seed.clip} has a body without length")
    motion = body_motion(positions, seed.fps)
    parts = ranges(len(motion))
    start, stop = parts[int(np.random.default_rng(chance).integers(len(parts)))]
    piece = motion.cut(start, stop)
    found = even_motion(piece) if cyclic else sparse_motion(piece, sparse)
    places = (start + found.places[:SEEDS]) / FPS * seed.fps
    last = int(min(round(places[-1]), len(positions) - 1))
    root = positions[last, 0].astype(float)
    height = motion.height[min(len(motion) - 1, round(start + found.places[SEEDS - 1]))]
    root[1] -= height * measured_length(positions)
    yaw = float(facing(positions[last : last + 1])[0])
    state = state_at(piece, found.places[SEEDS - 1 : SEEDS], cyclic)[0]
    return StartState(found.rows[:SEEDS], state, root, yaw, begin + int(places[0]), begin + last + 1)


@dataclass(frozen=True)
class TrainedGenerator:
    """A frozen generator.

    Attributes:
        config: what it was trained for.
        classes: [C] it was trained on.
        cyclic: [C] whether the motion of a class is cyclic, as walking, or ends, as a kick (`cyclic_classes`).
        reach: [C] median number of poses that follow the first five in training motions (`reach`); later predictions
            are not used, since the network had no examples of them.
        glogen, locgen: networks in evaluation mode, on the CPU; GloGen has one for each cyclic class.
        onset: predicts the frames right after a seed clip; nothing of the thesis's recipe.
        metrics: metrics of its training.
    """

    config: SynthesisConfig
    classes: list[str]
    cyclic: list[bool]
    reach: list[int]
    glogen: ByClass
    locgen: DenseDecoder | Inbetweener
    onset: Onset
    metrics: Mapping[str, Any]

    def generate(self, requests: Sequence[MotionRequest]) -> list[GeneratedMotion]:
        """Generate one motion for each request; the same request gives the same motion, whatever the others are.

        Raises:
            ValueError: a class that it does not know, no seconds, no pace, a seed clip shorter than needed or of
                another skeleton.
        """
        if any(request.keys is not None for request in requests):
            return [one for request in requests for one in self._one(request)]
        for request in requests:
            request.check(self.classes)
        starts = [self._start(request) for request in requests]
        with on_threads(1):
            rollouts = roll_out(self.glogen, [self._rollout(r, s) for r, s in zip(requests, starts, strict=True)])
            made: list[GeneratedMotion | None] = [None] * len(requests)
            for frames in sorted({_frames(request) for request in requests}):
                chosen = [i for i, request in enumerate(requests) if _frames(request) == frames]
                rows = [np.stack(rollouts[i].rows) for i in chosen]
                times = [rollouts[i].times() for i in chosen]
                for i, motion in zip(chosen, dense_motions(self.locgen, rows, times, frames), strict=True):
                    start, body = starts[i], requests[i].start.rest_offsets
                    begun = with_onset(motion, self._ahead(requests[i], start, rollouts[i].slowed))
                    positions, rotations = in_world(begun, body, start.root, start.yaw)
                    begins = tuple(min(frames - 1, round(second * FPS)) for second in rollouts[i].begins)
                    made[i] = GeneratedMotion(positions, rotations, body, FPS, begins, start.first, start.last)
        return [one for one in made if one is not None]

    def _one(self, request: MotionRequest) -> list[GeneratedMotion]:
        if request.keys is None:
            return self.generate([request])
        request.check(self.classes)
        with on_threads(1):
            return [keyed_motion(self.locgen, request)]

    def _start(self, request: MotionRequest) -> StartState:
        cyclic = self.cyclic[self.classes.index(request.classes[0])]
        return start_state(request.start, request.seed, self.glogen.recipe.sparse, cyclic)

    def _ahead(self, request: MotionRequest, start: StartState, slowed: float) -> Float64Array | None:
        return self.onset.ahead(start.state, self.classes.index(request.classes[0]), request.pace / slowed)

    def _rollout(self, request: MotionRequest, start: StartState) -> Rollout:
        targets = [self.classes.index(name) for name in request.classes]
        rng = np.random.default_rng(request.seed)
        latent = request.temperature * rng.standard_normal((len(targets), max(1, self.glogen.recipe.latent)))
        ending = [self.glogen.recipe.architecture == "ahead" and not self.cyclic[target] for target in targets]
        reach = [self.reach[target] for target in targets]
        return Rollout(start.rows, targets, latent, request.seconds, request.pace, ending, reach)

    def _networks(self) -> nn.ModuleDict:
        return nn.ModuleDict({"glogen": self.glogen, "locgen": self.locgen, "onset": self.onset})

    def save(self, path: Path) -> None:
        """Write it as one safetensors file."""
        kept = {
            "config": asdict(self.config), "classes": self.classes, "going": self.cyclic, "reach": self.reach,
            "figures": dict(self.metrics), "examples": len(self.onset.classes), "onset_features": FEATURES,
            "joints": list(JOINTS), "glogen": asdict(self.glogen.recipe), "networks": self.glogen.of,
            "onset": asdict(self.onset.network.recipe), "locgen": asdict(self.locgen.recipe),
        }  # fmt: skip
        save_network(path, self._networks(), METADATA_KEY, kept)


def _frames(request: MotionRequest) -> int:
    return max(2, round(request.seconds * FPS))


def load_generator(path: Path) -> TrainedGenerator:
    """Read what `TrainedGenerator.save` wrote.

    Raises:
        ValueError: the file holds something else, or a generator of another skeleton or of an earlier version.
    """
    tensors, kept = read_network(path, METADATA_KEY)
    if kept["joints"] != list(JOINTS):
        raise ValueError(f"{path} was trained on another skeleton: {', '.join(kept['joints'])}")
    if kept.get("onset_features") != FEATURES or "networks" not in kept:
        raise ValueError(f"{path} was made by an earlier version; train one anew with `motionlake train synthesis`")
    recipe = GloGenRecipe(**kept["glogen"])
    glogen = ByClass(recipe, [glogen_network(recipe, len(own)) for own in kept["networks"]], kept["networks"])
    locgen = locgen_network(LocGenRecipe(**kept["locgen"]))
    network = OnsetNetwork(len(kept["classes"]), OnsetRecipe(**kept["onset"]))
    onset = Onset(len(kept["classes"]), network, kept["examples"]).eval()
    config = SynthesisConfig(**kept["config"])
    generator = TrainedGenerator(
        config, kept["classes"], kept["going"], kept["reach"], glogen.eval(), locgen.eval(), onset, kept["figures"]
    )
    generator._networks().load_state_dict(tensors)
    return generator


@dataclass(frozen=True)
class EmbeddedMotions:
    """Motions as the encoder of a generator embeds them.

    Attributes:
        labels: [n] their classes.
        with_class: [n, E] embeddings of their sparse poses, five by five, with the class prior, as in figure 4.7.
        alone: [n, E] the same without the class prior.
    """

    labels: list[str]
    with_class: Float32Array
    alone: Float32Array


def embed_motions(generator: TrainedGenerator, motions: Sequence[TrainingMotion]) -> EmbeddedMotions:
    """Embed motions of the generator's classes: the first piece of long motions; short motions are left out."""
    chosen = [motion for motion in motions if len(motion.positions) / motion.fps * FPS >= SHORTEST]
    count = generator.glogen.recipe.sparse
    rows = np.zeros((len(chosen), count, WIDTH), dtype=np.float32)
    for i, motion in enumerate(chosen):
        body = body_motion(motion.positions, motion.fps)
        rows[i] = sparse_motion(body.cut(*ranges(len(body))[0]), count).rows
    targets = torch.tensor([generator.classes.index(motion.label) for motion in chosen], dtype=torch.int64)
    with on_threads(1), torch.inference_mode():
        found = [
            generator.glogen.embedding(torch.from_numpy(rows), targets, with_class=known).numpy()
            for known in (True, False)
        ]
    return EmbeddedMotions([motion.label for motion in chosen], *found)


@dataclass(frozen=True)
class TrainingMotion:
    """A clip to train on: [F, 21, 3] canonical joints in metres, y up, its rate, its class."""

    positions: Float64Array
    fps: float
    label: str

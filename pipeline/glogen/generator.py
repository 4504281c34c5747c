"""A trained generator: from requests to motion, sparse poses first, dense frames then (section 4.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Float64Array
from motionlake.glogen.config import GloGenRecipe, SynthesisConfig
from motionlake.glogen.course import Course, go_on
from motionlake.glogen.inbetweening import Between, Frames, LocGenRecipe, dense_motions, locgen_network
from motionlake.glogen.lead_in import FEATURES, LeadIn, led_in
from motionlake.glogen.sparse import WIDTH, ranges, sparse_motion
from motionlake.glogen.training import ByClass, untrained
from motionlake.glogen.trajectories import FPS, body_motion, in_world
from motionlake.glogen.wishes import SHORTEST, Start, Synthesized, Wish, start_of
from motionlake.motion.skeleton import JOINTS
from motionlake.training import on_threads, read_network, save_network
from torch import nn


@dataclass(frozen=True)
class EmbeddedMotions:
    """Motions as a generator reads them.

    Attributes:
        labels: [n] their classes.
        with_class: [n, E] embeddings of their sparse poses, five by five, with the class prior, as in figure 4.7.
        alone: [n, E] without it: what the poses themselves say.
    """

    labels: list[str]
    with_class: Float32Array
    alone: Float32Array


def embed_motions(generator: TrainedGenerator, motions: Sequence[TrainingMotion]) -> EmbeddedMotions:
    """Embed motions of classes that the generator knows; of long ones the first piece; short ones are left out."""
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


METADATA_KEY: Final = "motion_generator"


@dataclass(frozen=True)
class TrainedGenerator:
    """A frozen generator.

    Attributes:
        config: what it was trained for.
        classes: [C] it knows.
        going: [C] whether the motion of each goes on, or comes to its end (`pieces.goes_on`).
        reach: [C] how many poses after the given ones the motions of each have (`pieces.reach`): what the network says
            of the class beyond these it has not learned.
        glogen, locgen: networks in evaluation mode, on the CPU; GloGen has one for each class that goes on.
        lead: how motion goes on from recorded frames.
        figures: of its training.
    """

    config: SynthesisConfig
    classes: list[str]
    going: list[bool]
    reach: list[int]
    glogen: ByClass
    locgen: Frames | Between
    lead: LeadIn
    figures: Mapping[str, Any]

    def generate(self, wishes: Sequence[Wish]) -> list[Synthesized]:
        """The motions wished for; the same for the same wish, whatever the others.

        Raises:
            ValueError: a class that it does not know, no seconds, no pace, a seed clip shorter than needed or of
                another skeleton.
        """
        for wish in wishes:
            self._check(wish)
        starts = [self._start(wish) for wish in wishes]
        with on_threads(1):
            courses = go_on(self.glogen, [self._course(w, s) for w, s in zip(wishes, starts, strict=True)])
            made: list[Synthesized | None] = [None] * len(wishes)
            for frames in sorted({_frames(wish) for wish in wishes}):
                chosen = [i for i, wish in enumerate(wishes) if _frames(wish) == frames]
                rows = [np.stack(courses[i].rows) for i in chosen]
                times = [courses[i].times() for i in chosen]
                for i, motion in zip(chosen, dense_motions(self.locgen, rows, times, frames), strict=True):
                    begun = led_in(motion, self._ahead(wishes[i], starts[i]))
                    positions, rotations = in_world(begun, wishes[i].start.rest_offsets, starts[i].root, starts[i].yaw)
                    made[i] = _given(wishes[i], starts[i], courses[i], positions, rotations)
        return [one for one in made if one is not None]

    def _check(self, wish: Wish) -> None:
        if not wish.classes:
            raise ValueError("no class is asked for")
        for name in wish.classes:
            if name not in self.classes:
                raise ValueError(f"class {name!r} is none of this generator's {len(self.classes)}")
        if not (np.isfinite(wish.seconds) and wish.seconds > 0):
            raise ValueError(f"{wish.seconds} seconds of motion cannot be made; ask for more than 0")
        if not (np.isfinite(wish.pace) and wish.pace > 0):
            raise ValueError(f"pace {wish.pace} is none; 1 is that of the recordings, 2 twice as fast")
        if not (np.isfinite(wish.temperature) and wish.temperature >= 0):
            raise ValueError(f"temperature {wish.temperature} is none; 0 leaves nothing to chance, 1 what is natural")

    def _start(self, wish: Wish) -> Start:
        going = self.going[self.classes.index(wish.classes[0])]
        return start_of(wish.start, wish.seed, self.glogen.recipe.sparse, going)

    def _ahead(self, wish: Wish, start: Start) -> Float64Array | None:
        target = self.classes.index(wish.classes[0])
        return None if start.state is None else self.lead.ahead(start.state, target, wish.pace)

    def _course(self, wish: Wish, start: Start) -> Course:
        targets = [self.classes.index(name) for name in wish.classes]
        rng = np.random.default_rng(wish.seed)
        latent = wish.temperature * rng.standard_normal((len(targets), max(1, self.glogen.recipe.latent)))
        ending = [self.glogen.recipe.architecture == "ahead" and not self.going[target] for target in targets]
        return Course(
            start.rows, targets, latent, wish.seconds, wish.pace, ending, [self.reach[target] for target in targets]
        )

    def _networks(self) -> nn.ModuleDict:
        return nn.ModuleDict({"glogen": self.glogen, "locgen": self.locgen, "lead": self.lead})

    def save(self, path: Path) -> None:
        """Write it as one safetensors file."""
        kept = {
            "config": asdict(self.config), "classes": self.classes, "going": self.going, "reach": self.reach,
            "figures": dict(self.figures), "examples": len(self.lead.classes), "lead_features": FEATURES,
            "joints": list(JOINTS), "glogen": asdict(self.glogen.recipe), "networks": self.glogen.of,
            "locgen": asdict(self.locgen.recipe),
        }  # fmt: skip
        save_network(path, self._networks(), METADATA_KEY, kept)


def _frames(wish: Wish) -> int:
    return max(2, round(wish.seconds * FPS))


def _given(wish: Wish, start: Start, course: Course, positions: Float64Array, rotations: Float64Array) -> Synthesized:
    begins = tuple(min(len(positions) - 1, round(second * FPS)) for second in course.begins)
    return Synthesized(positions, rotations, wish.start.rest_offsets, FPS, begins, start.first, start.last)


def load_generator(path: Path) -> TrainedGenerator:
    """Read what `TrainedGenerator.save` wrote.

    Raises:
        ValueError: the file holds something else, or a generator of another skeleton or of an earlier version.
    """
    tensors, kept = read_network(path, METADATA_KEY)
    if kept["joints"] != list(JOINTS):
        raise ValueError(f"{path} was trained on another skeleton: {', '.join(kept['joints'])}")
    if kept.get("lead_features") != FEATURES or "networks" not in kept:
        raise ValueError(f"{path} was made by an earlier version; train one anew with `motionlake train synthesis`")
    glogen = untrained(GloGenRecipe(**kept["glogen"]), kept["networks"])
    locgen = locgen_network(LocGenRecipe(**kept["locgen"]))
    lead = LeadIn(len(kept["classes"]), kept["examples"])
    config = SynthesisConfig(**kept["config"])
    generator = TrainedGenerator(
        config, kept["classes"], kept["going"], kept["reach"], glogen.eval(), locgen.eval(), lead, kept["figures"]
    )
    generator._networks().load_state_dict(tensors)
    return generator


@dataclass(frozen=True)
class TrainingMotion:
    """A clip to train on: [F, 21, 3] canonical joints in metres, y up, its rate, its class."""

    positions: Float64Array
    fps: float
    label: str

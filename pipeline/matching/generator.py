"""Motion matching as a generator: from requests to motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.matching.assembly import Poses, assembled, in_world
from motionlake.matching.course import GIVEN, Course, Part, Start
from motionlake.matching.database import APART, MotionDatabase, load_database
from motionlake.matching.features import features
from motionlake.matching.feet import Soles, heights_standing, on_ground, standing_above
from motionlake.matching.keyed import keyed_motion
from motionlake.matching.player import Player
from motionlake.matching.recordings import (
    FPS,
    RootedMotion,
    about_y,
    longest_range,
    rooted,
    seed_rotations,
    seen_from,
    steps_of,
)
from motionlake.matching.sources import course_sources
from motionlake.matching.steering import Steering
from motionlake.matching.style import style_costs
from motionlake.motion.generation import SHORTEST, Control, GeneratedMotion, MotionRequest, SeedClip
from motionlake.motion.ground import standing_level
from motionlake.motion.kinematics import forward_kinematics
from motionlake.motion.limbs import even_limbs
from motionlake.motion.rotations import multiply, turn_on_ground
from motionlake.motion.skeleton import JOINTS, body_length

PIECE: Final = 100  # frames of a long seed clip from start to start


@dataclass(frozen=True)
class Given:
    """The frames that a motion goes on from, in the world.

    Attributes:
        motion: seen from the root, up to the last given frame, turned about that so that the ground is level.
        shown: the last two frames as recorded, seen from the root likewise.
        lowest: [4] metres, where joints of the feet stand.
        floor: metres by which they stand higher in the last frame; 0 where none does.
        body: [21, 3] rest offsets of the motion, metres.
        first, last: frames [first, last) of the seed clip at its own rate.
    """

    motion: RootedMotion
    shown: Poses
    lowest: Float64Array
    floor: float
    body: Float64Array
    first: int
    last: int


@dataclass(frozen=True)
class MatchingGenerator:
    """A frozen generator: a database, and nothing that was trained."""

    database: MotionDatabase

    @property
    def classes(self) -> list[str]:
        return self.database.classes

    @property
    def metrics(self) -> Mapping[str, Any]:
        return self.database.metrics

    @cached_property
    def usual(self) -> list[float]:
        """Usual speed of every class, body lengths a second; 0 of one that stays."""
        return [self.database.usual_speed(target) for target in range(len(self.classes))]

    def generate(self, requests: Sequence[MotionRequest]) -> list[GeneratedMotion]:
        """One motion for each request; the same request gives the same motion, whatever the others are.

        Raises:
            ValueError: a class that it does not know, no seconds, no pace, a seed clip shorter than needed or of
                another skeleton, or a path for which the time is too short or too long.
        """
        styles = {id(s): s for r in requests if (s := (r.control or Control()).style) is not None}
        costs = {key: style_costs(self.database, style) for key, style in styles.items()}
        return [self._made(request, costs.get(id((request.control or Control()).style))) for request in requests]

    def save(self, path: Path) -> None:
        """Write it as one safetensors file."""
        self.database.save(path)

    def _made(self, request: MotionRequest, style: Float64Array | None) -> GeneratedMotion:
        if request.keys is not None:
            return keyed_motion(self.database, request)
        request.check(self.classes)
        control = request.control or Control()
        frames = max(2, round(request.seconds * FPS))
        given = given_frames(request.start, request.seed, control.from_end)
        size = body_length(given.body)
        parts = self._parts(request, control, frames, size)
        rng = np.random.default_rng(request.seed)
        start = _start(given.motion)
        steering = None
        if control.path is not None:
            speeds = self._speeds(parts, frames)
            heading = start.heading
            facing = None if control.facing is None else heading + control.facing
            steering = Steering(control.path, size, start.place, heading, speeds, facing)
        player = Player(
            self.database, parts, frames, rng, pace=request.pace, temperature=request.temperature, steering=steering,
            loop=control.loop, style=style,
        )  # fmt: skip
        course = player.run(start, drawn=control.loop and steering is None)
        if control.loop and control.path is not None:
            course = _closed(course)
        return self._posed(request, given, course, parts, None if control.loop else given.shown)

    def _posed(
        self, request: MotionRequest, given: Given, course: Course, parts: list[Part], shown: Poses | None
    ) -> GeneratedMotion:
        body, size = given.body, body_length(given.body)
        poses = assembled(self.database, course, shown)
        hips, rotations = in_world(poses, course, size)
        soles = Soles(given.lowest, None if shown is None else given.floor)
        frames = course.at.astype(int)
        near, longest = self.database.aloft[frames] == 0, self.database.longest_flights[frames] / request.pace
        hips, rotations = on_ground(hips, rotations, body, poses.stands, soles, size, near, longest)
        hips[:, 1] += given.motion.ground
        positions = forward_kinematics(hips, rotations, body)
        starts = tuple(part.first for part in parts)
        sources = course_sources(self.database, course)
        return GeneratedMotion(positions, rotations, body, FPS, starts, given.first, given.last, sources)

    def _parts(self, request: MotionRequest, control: Control, frames: int, size: float) -> list[Part]:
        targets = [self.classes.index(name) for name in request.classes]
        shares = np.array(request.shares or [1.0] * len(targets))
        firsts = np.concatenate([[0.0], np.cumsum(shares)[:-1]]) / shares.sum() * frames
        going = len(set(targets)) > 1 or control.path is not None or control.speed is not None
        speeds: list[float | None] = [self.usual[target] or None if going else None for target in targets]
        if control.speed is not None:
            speeds = [control.speed / size] * len(targets)
        return [
            Part(target, min(frames - 1, round(first)), speed, control.speed is not None)
            for target, first, speed in zip(targets, firsts, speeds, strict=True)
        ]

    def _speeds(self, parts: list[Part], frames: int) -> Float64Array:
        speeds = np.empty(frames)
        for part in parts:
            speeds[part.first :] = part.speed or 0.0
        return speeds


def given_frames(seed: SeedClip, chance: int, from_end: bool) -> Given:
    """The frames of a seed clip that a motion goes on from: its last, or the first of it or of one piece of a long one.

    Raises:
        ValueError: the clip is shorter than needed, or of another skeleton.
    """
    if seed.positions.ndim != 3 or seed.positions.shape[1:] != (len(JOINTS), 3):
        shape = "x".join(map(str, seed.positions.shape[1:]))
        raise ValueError(f"{seed.clip} is of another skeleton: {shape} numbers a frame, not {len(JOINTS)}x3")
    if body_length(seed.rest_offsets) < 1e-6:
        raise ValueError(f"{seed.clip} has a body without length")
    rotations, body = seed_rotations(seed), even_limbs(seed.positions, seed.rest_offsets)
    first, stop = _sound(seed, rotations)
    frames = round((stop - first - 1) / seed.fps * FPS) + 1
    if frames < SHORTEST:
        seconds = len(seed.positions) / seed.fps
        raise ValueError(f"{seed.clip} lasts {seconds:.2f} s; to start from it needs {SHORTEST / FPS:.2f} s at least")
    recorded = seed.positions[first:stop], rotations[first:stop]
    turned = rooted(*recorded, body, seed.fps)
    begins = np.arange(0, max(1, len(turned) - PIECE), PIECE)
    begin = int(begins[np.random.default_rng(chance).integers(len(begins))])
    end = len(turned) if from_end else min(len(turned), begin + GIVEN)
    at = [round(first + frame / FPS * seed.fps) for frame in (end - GIVEN, end - 1)]
    motion = rooted(*standing_level(*recorded, at[1] - first), body, seed.fps)
    size = body_length(body)
    lowest = heights_standing(motion.joints, 0.0) * size
    cut = motion.cut(end - GIVEN, end)
    shown = _seen_from(cut, turned.cut(end - GIVEN, end), size)
    return Given(
        cut,
        shown,
        lowest,
        standing_above(cut.joints[-1] * size, cut.stands[-1], lowest),
        body,
        at[0],
        min(at[1] + 1, len(seed.positions)),
    )


def _seen_from(roots: RootedMotion, motion: RootedMotion, size: float) -> Poses:
    """The last two frames of a motion, seen from the roots of another."""
    x, z = turn_on_ground(motion.hips[-2:, 0], motion.hips[-2:, 2], motion.heading[-2:])
    up = motion.hips[-2:, 1] + (motion.ground - roots.ground) / size
    world = np.stack([motion.place[-2:, 0] + x, up, motion.place[-2:, 1] + z], axis=1)
    rotations = motion.rotations[-2:].copy()
    rotations[:, 0] = multiply(about_y(motion.heading[-2:] - roots.heading[-2:]), rotations[:, 0])
    hips = seen_from(world[:, None], roots.place[-2:], roots.heading[-2:])[:, 0]
    return Poses(rotations, hips, roots.stands[-2:])


def _sound(seed: SeedClip, rotations: Float64Array) -> tuple[int, int]:
    """The longest stretch of the clip without calibration poses and jumps; all of it where that is too short."""
    if len(seed.positions) < 2:
        return 0, len(seed.positions)
    found = longest_range(seed.positions, rotations, seed.fps)
    return found if (found[1] - found[0] - 1) / seed.fps * FPS + 1 >= SHORTEST else (0, len(seed.positions))


def _start(motion: RootedMotion) -> Start:
    """The last given frame, from which the root goes on as it went."""
    rows = features(motion)
    step = steps_of(motion)[-1]
    last, heading = motion.place[-1], float(motion.heading[-1])
    moved = motion.place[-1] - motion.place[-2]
    return Start(rows[-1], float(motion.aloft[-1]), step, last + moved, heading + step[2] / FPS, rows[-1 - APART])


def _closed(course: Course) -> Course:
    """A course whose end is led to its beginning: what it misses is spread over all of it."""
    count = len(course.at)
    share = np.linspace(0, 1, count)
    place, heading = course.place, course.heading
    off = place[0] - (place[-1] + (place[-1] - place[-2]))
    turned = heading[0] - heading[-1]
    turned -= 2 * np.pi * np.round(turned / (2 * np.pi))
    return replace(course, place=place + share[:, None] * off, heading=heading + share * turned)


def load_generator(path: Path) -> MatchingGenerator:
    """Read what `MatchingGenerator.save` wrote.

    Raises:
        ValueError: the file holds something else, or frames of another skeleton or version.
    """
    return MatchingGenerator(load_database(path))

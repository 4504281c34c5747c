"""Motion matching through given poses: recorded runs between them, led to those that are far off in time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from motionlake.arrays import BoolArray, Float64Array
from motionlake.matching.assembly import assembled, in_world
from motionlake.matching.course import Course, Part, Start
from motionlake.matching.database import MotionDatabase
from motionlake.matching.inbetweening import LONGEST, Inbetweens, Run, feet
from motionlake.matching.keyed_feet import feet_held
from motionlake.matching.player import Player
from motionlake.matching.recordings import FPS
from motionlake.matching.sources import course_sources, run_source
from motionlake.matching.steering import Steering
from motionlake.motion.generation import GeneratedMotion, MotionRequest, Source
from motionlake.motion.keyframes import KeyPoses, Stretch, even_stretch, ground_below, through
from motionlake.motion.kinematics import continuous_signs, forward_kinematics
from motionlake.motion.paths import ground_path
from motionlake.motion.resampling import interpolated
from motionlake.motion.rotations import normalise
from motionlake.motion.skeleton import body_length

TAIL: Final = 45  # frames at 30 a second, before a pose that is far off, that are one run
TRIES: Final = 6  # ways there that are compared
FAR: Final = 0.5  # body lengths: to a pose that is nearer than that no path leads


@dataclass(frozen=True)
class _Led:
    """A stretch that motion matching made, whether feet stand [n + 1, 2], its course, and its first frame."""

    stretch: Stretch
    stands: BoolArray
    course: Course
    start: int


def keyed_motion(database: MotionDatabase, request: MotionRequest) -> GeneratedMotion:
    """The motion through the poses of a request, by recorded frames of its classes.

    Raises:
        ValueError: no class, or one that is not known, or a seed clip of another skeleton.
    """
    assert request.keys is not None, "a request of poses"
    request.check(database.classes)
    body, keys = request.start.rest_offsets, request.keys
    ground = ground_below(request.start.positions, request.start.clip)
    keys = KeyPoses(keys.frames, keys.hips - [0.0, ground, 0.0], keys.rotations, keys.speeds, keys.fps)
    targets = sorted({database.classes.index(name) for name in request.classes})
    found = Inbetweens(database, targets, body)
    rng = np.random.default_rng(request.seed)
    keys, led = _far_ones_led(database, found, keys, body, rng, request.temperature)
    runs = found.runs(keys, rng, request.temperature)
    stretches, stands = [], [np.zeros((1, 2), dtype=np.bool_)]
    for i, run in enumerate(runs):
        if i in led:
            stretch, own = led[i].stretch, led[i].stands
        elif run is not None:
            stretch, own = found.stretch(run, keys, i)
        else:
            stretch = even_stretch(keys, i)
            own = np.zeros((len(stretch.hips), 2), dtype=np.bool_)
        stands[-1][-1] |= own[0]
        stretches.append(stretch)
        stands.append(own[1:])
    hips, rotations = through(keys, stretches)
    rotations = feet_held(
        hips, rotations, body, np.concatenate(stands), request.keys.frames - keys.frames[0], keys.fps, body_length(body)
    )
    hips[:, 1] += ground
    positions = forward_kinematics(hips, rotations, body)
    return GeneratedMotion(positions, rotations, body, keys.fps, (0,), 0, 1, _sources(database, keys, runs, led))


def _far_ones_led(
    database: MotionDatabase, found: Inbetweens, keys: KeyPoses, body: Float64Array, rng: np.random.Generator,
    temperature: float,
) -> tuple[KeyPoses, dict[int, _Led]]:  # fmt: skip
    """The poses and those that motion matching leads to, where one run is not enough; and what leads there."""
    led: dict[int, _Led] = {}
    frames, hips, rotations = [keys.frames[:1]], [keys.hips[:1]], [keys.rotations[:1]]
    for i in range(len(keys.frames) - 1):
        if (keys.frames[i + 1] - keys.frames[i]) * FPS / keys.fps > LONGEST:
            pair = keys.cut(i, i + 2)
            tries = [_led(database, found, pair, body, rng, temperature) for _ in range(TRIES)]
            best = min(tries, key=lambda one: found.likeness(_after(one, pair)))
            led[len(frames) - 1] = best
            frames.append(_after(best, pair).frames[:1])
            hips.append(best.stretch.hips[-1:])
            rotations.append(best.stretch.rotations[-1:])
        frames.append(keys.frames[i + 1 : i + 2])
        hips.append(keys.hips[i + 1 : i + 2])
        rotations.append(keys.rotations[i + 1 : i + 2])
    everything = KeyPoses(
        np.concatenate(frames), np.concatenate(hips), np.concatenate(rotations), keys.speeds, keys.fps
    )
    return everything, led


def _after(led: _Led, pair: KeyPoses) -> KeyPoses:
    """The pose that is led to, and the next that is given."""
    at = led.start + len(led.stretch.hips) - 1
    last = (led.stretch.hips[-1:], led.stretch.rotations[-1:])
    hips, rotations = (
        np.concatenate([one, own[1:]]) for one, own in zip(last, (pair.hips, pair.rotations), strict=True)
    )
    return KeyPoses(np.array([at, pair.frames[1]]), hips, rotations, fps=pair.fps)


def _led(
    database: MotionDatabase, found: Inbetweens, pair: KeyPoses, body: Float64Array, rng: np.random.Generator,
    temperature: float,
) -> _Led:  # fmt: skip
    """What motion matching makes from a pose on towards the next, until a run's length before that."""
    size = body_length(body)
    row, mirrored, heading = found.nearest(pair)
    seconds = float(pair.frames[1] - pair.frames[0]) / pair.fps
    count = round((seconds - TAIL / FPS) * pair.fps)  # frames that are led
    steps = database.steps[row].astype(float) * np.array([-1.0 if mirrored else 1.0, 1.0])
    turn = float(database.turns[row]) * (-1.0 if mirrored else 1.0)
    place = pair.hips[0, [0, 2]] / size
    query, aloft = database.compared[row + mirrored * len(database)], float(database.aloft[row])
    start = Start(query, aloft, np.array([*steps, turn]), place, heading)
    way = (pair.hips[1, [0, 2]] - pair.hips[0, [0, 2]]) / size
    target, frames = int(database.pieces[database.piece_of[row], 2]), round(count / pair.fps * FPS) + 1
    steering = None
    if (far := float(np.hypot(*way))) > FAR:
        points = np.array([[0.0, 0.0], [0.0, far * size]])
        speeds = np.full(frames, far / seconds)
        steering = Steering(ground_path(points), size, place, float(np.arctan2(way[0], way[1])), speeds)
    player = Player(database, [Part(target, 0)], frames, rng, temperature=temperature, steering=steering)
    course = player.run(start)
    poses = assembled(database, course, None)
    hips, rotations = in_world(poses, course, size)
    at = np.linspace(0, frames - 1, count + 1)
    turned = normalise(interpolated(continuous_signs(rotations), at))
    stands = feet(poses.stands)[np.round(at).astype(int)]
    return _Led(Stretch(interpolated(hips, at), turned), stands, course, int(pair.frames[0]))


def _sources(
    database: MotionDatabase, keys: KeyPoses, runs: Sequence[Run | None], led: Mapping[int, _Led]
) -> list[Source]:
    found = []
    for i, run in enumerate(runs):
        first = int(keys.frames[i] - keys.frames[0])
        stop = int(keys.frames[i + 1] - keys.frames[0]) + (i == len(runs) - 1)
        if i in led:
            for source in course_sources(database, led[i].course):
                edges = (first + round(at / FPS * keys.fps) for at in (source.start, source.stop))
                start, end = (min(edge, stop) for edge in edges)
                found += [replace(source, start=start, stop=end)] * (end > start)
        elif run is not None:
            found.append(run_source(database, (first, stop), (run.row, run.row + run.frames), run.mirrored))
    return found

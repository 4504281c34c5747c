"""The frames that motion is made from, of clips of known class, with their mirror images."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Float64Array, Int64Array
from motionlake.matching import DATABASE_VERSION
from motionlake.matching.actions import FASTEST, comes_to_rest, has_a_course
from motionlake.matching.features import AHEAD, PLACES, POSE, VELOCITIES, mirrored_features, scales
from motionlake.matching.recordings import FPS
from motionlake.motion.sides import names_a_side, unlike_mirrored
from motionlake.motion.skeleton import JOINTS
from motionlake.weights import read_tensors, save_tensors

METADATA_KEY: Final = "matching_database"
APART: Final = 3  # frames: poses so near in time are joined and nobody sees it
LEAST_SPEED: Final = 0.3  # body lengths a second: a class whose frames mostly go faster gets about
ASKED, AMONG = 300, 3000  # frames of a class that are compared, and with how many, to tell what it is like
_TENSORS: Final = (
    "rotations",
    "hips",
    "steps",
    "turns",
    "stands",
    "aloft",
    "flights",
    "features",
    "pieces",
    "fps",
    "begins",
)


@dataclass(frozen=True)
class MotionDatabase:
    """N frames at 30 a second in M pieces; row n + N is frame n mirrored left to right. Lengths are in body lengths.

    Attributes:
        classes: names, sorted.
        clips: [M] name of the clip of each piece.
        pieces: [M, 4] first row and the one after the last, class, and the frame of its clip that is the first.
        fps: [M] of the clips.
        begins: [M] tolerances that it costs to begin a motion in each piece (`hubs.costs_of_beginning`).
        rotations: [N, 21, 4] local; the hips' are relative to the root's heading.
        hips: [N, 3] from the root on the ground.
        steps: [N, 2] of the root to the next frame (left, ahead), a second.
        turns: [N] of the root's heading to the next frame, radians a second.
        stands: [N, 4] whether ankle and toe stand, left and right.
        aloft: [N] frames for which no foot was near the ground.
        flights: [C, L] frames of the longest flight of each class (`flights.longest_flights`).
        features: [N, 48].
        metrics: of how it was made.
    """

    classes: list[str]
    clips: list[str]
    pieces: Int64Array
    fps: Float64Array
    begins: Float64Array
    rotations: Float32Array
    hips: Float32Array
    steps: Float32Array
    turns: Float32Array
    stands: BoolArray
    aloft: Float32Array
    flights: Float64Array
    features: Float32Array
    metrics: dict[str, Any]

    def __len__(self) -> int:
        return len(self.hips)

    @cached_property
    def scales(self) -> Float32Array:
        """[48] that make features comparable."""
        return scales(self.features)

    @cached_property
    def pose_scales(self) -> Float32Array:
        """[48] of these, 0 of where the root goes: of given frames that is not known."""
        found = self.scales.copy()
        found[POSE:] = 0
        return found

    @cached_property
    def compared(self) -> Float32Array:
        """[2 N, 48] features of all rows."""
        return np.concatenate([self.features, mirrored_features(self.features)])

    @cached_property
    def piece_of(self) -> Int64Array:
        """[N] piece of every frame."""
        return np.repeat(np.arange(len(self.pieces)), self.pieces[:, 1] - self.pieces[:, 0])

    @cached_property
    def recordings(self) -> Int64Array:
        """[2 N] piece of every row; a mirror image is another recording."""
        return np.concatenate([self.piece_of, self.piece_of + len(self.pieces)])

    @cached_property
    def left(self) -> Int64Array:
        """[N] frames that follow in the piece."""
        return np.asarray(self.pieces[self.piece_of, 1] - 1 - np.arange(len(self)))

    @cached_property
    def frames(self) -> list[Int64Array]:
        """Of every class, its frames."""
        target = self.pieces[self.piece_of, 2]
        return [np.flatnonzero(target == i) for i in range(len(self.classes))]

    @cached_property
    def rows(self) -> list[Int64Array]:
        """Of every class, its rows, mirrored ones too but where it is done with one side."""
        return [
            own if self.is_handed(i) else np.concatenate([own, own + len(self)]) for i, own in enumerate(self.frames)
        ]

    def is_handed(self, target: int) -> bool:
        """Whether a class is done with one side: its name says which, or, mirrored, its poses are further from other
        recordings of it.
        """
        if names_a_side(self.classes[target]):
            return True
        asked, among = self._some(self.frames[target])
        poses, pieces = self.compared[:, :POSE] * self.scales[:POSE], self.piece_of
        return unlike_mirrored(poses[asked], poses[asked + len(self)], pieces[asked], poses[among], pieces[among])

    def is_resting(self, target: int) -> bool:
        """Whether the recordings of a class are short and come to rest (`actions.comes_to_rest`)."""
        return self._kind(target)[0]

    def is_action(self, target: int) -> bool:
        """Whether a class is done and not gone on with: it comes to rest, or has a course (`actions`)."""
        return self._kind(target)[1]

    def _kind(self, target: int) -> tuple[bool, bool]:
        """Whether a class comes to rest, and whether it is an action: found out when it is first asked for."""
        if target not in self._kinds:
            rests = comes_to_rest(self._speeds, self.pieces[self.pieces[:, 2] == target, :2])
            self._kinds[target] = rests, rests or self._has_a_course(target)
        return self._kinds[target]

    @cached_property
    def _kinds(self) -> dict[int, tuple[bool, bool]]:
        return {}

    def _has_a_course(self, target: int) -> bool:
        speeds = self._speeds[self.frames[target]]
        asked, among = self._some(self.frames[target], speeds >= np.quantile(speeds, 1 - FASTEST))
        poses, places = [], []
        for frames in (asked, among):
            first, stop = self.pieces[self.piece_of[frames], :2].T
            places.append((frames - first) / np.maximum(1, stop - 1 - first))
            poses.append(self.features[frames, :POSE] * self.scales[:POSE])
        clips = self.piece_of[asked], self.piece_of[among]
        return has_a_course(poses[0], clips[0], places[0], poses[1], clips[1], places[1])

    @cached_property
    def _speeds(self) -> Float64Array:
        """[N] mean squared speeds of the joints."""
        return np.asarray(np.square(self.features[:, VELOCITIES]).mean(axis=1, dtype=np.float64))

    def _some(self, own: Int64Array, chosen: BoolArray | None = None) -> tuple[Int64Array, Int64Array]:
        """Some of a class's frames [n], of the chosen ones [n] alone, and those that they are compared with."""
        rng = np.random.default_rng(0)
        asked = own if chosen is None else own[chosen]
        return rng.permutation(asked)[:ASKED], rng.permutation(own)[:AMONG]

    @cached_property
    def landing(self) -> Int64Array:
        """[N] frames until a foot is near the ground again, or the piece ends; 0 while one is."""
        frames = np.arange(len(self))
        down = np.where(self.aloft == 0, frames, len(self))
        following = np.minimum.accumulate(down[::-1])[::-1]
        return np.asarray(np.minimum(following, self.pieces[self.piece_of, 1]) - frames)

    def longest_flight(self, target: int) -> float:
        """Frames of the longest time off the ground that is recorded of a class."""
        return float(self.aloft[self.frames[target]].max())

    @cached_property
    def longest_flights(self) -> Float64Array:
        """[N, L] of every frame the frames of the longest flight of its class."""
        return np.asarray(self.flights[self.pieces[self.piece_of, 2]])

    @cached_property
    def tolerance(self) -> float:
        """How far poses are from one another that a tenth of a second lies between: the median."""
        here = np.flatnonzero(self.left >= APART)[:: max(1, len(self) // 20_000)]
        apart = (self.features[here + APART, :POSE] - self.features[here, :POSE]) * self.scales[:POSE]
        return float(np.median(np.linalg.norm(apart, axis=1)))

    def speeds(self, target: int) -> Float64Array:
        """Speeds of the root over the second that follows, of the frames of a class that has a second left."""
        own = self.frames[target]
        whole = own[self.left[own] >= AHEAD[-1]]
        chosen = whole if len(whole) else own
        ways: Float64Array = np.linalg.norm(self.features[chosen, PLACES][:, -2:].astype(float), axis=1)
        return ways / (AHEAD[-1] / FPS)

    def aside(self, target: int) -> float:
        """Share of the frames of a class that go, and go elsewhere within a second than within 45 degrees of ahead."""
        own = self.frames[target]
        ways = self.features[own, PLACES][:, -2:].astype(float)
        going = np.linalg.norm(ways, axis=1) > LEAST_SPEED * AHEAD[-1] / FPS
        return float((ways[going, 1] < np.abs(ways[going, 0])).mean()) if going.any() else 0.0

    def usual_speed(self, target: int) -> float:
        """Body lengths a second that a class goes, the median; 0 of one that mostly stays where it is."""
        speed = float(np.median(self.speeds(target)))
        return speed if speed > LEAST_SPEED else 0.0

    def save(self, path: Path) -> None:
        """Write it as one safetensors file."""
        tensors = {name: getattr(self, name) for name in _TENSORS}
        kept = {
            "version": DATABASE_VERSION, "joints": list(JOINTS), "classes": self.classes, "clips": self.clips,
            "figures": self.metrics,
        }  # fmt: skip
        save_tensors(path, tensors, METADATA_KEY, kept)


def load_database(path: Path) -> MotionDatabase:
    """Read what `MotionDatabase.save` wrote.

    Raises:
        ValueError: the file holds something else, or frames of another skeleton or version.
    """
    tensors, kept = read_tensors(path, METADATA_KEY)
    if kept["joints"] != list(JOINTS):
        raise ValueError(f"{path} holds frames of another skeleton: {', '.join(kept['joints'])}")
    if kept["version"] != DATABASE_VERSION:
        raise ValueError(f"{path} was made by another version; make it anew with `motionlake train synthesis`")
    return MotionDatabase(kept["classes"], kept["clips"], **tensors, metrics=kept["figures"])

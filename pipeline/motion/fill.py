"""Canonical joint positions: measured joints are picked, those a rig lacks are placed by its rules."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.clip import Hierarchy
from motionlake.motion.rigs import Fill, RigMap, bare_names
from motionlake.motion.rotations import rotate
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS


@dataclass(frozen=True)
class Binding:
    """A rig map bound to the joints of one file.

    Attributes:
        source: canonical joint index -> index of the joint in the file, measured joints only.
        rules: canonical joint index -> rule, filled joints only, each after the joints it needs.
        names: index of a joint in the file by its bare name.
    """

    source: dict[int, int]
    rules: dict[int, Fill]
    names: dict[str, int]

    @property
    def filled(self) -> tuple[str, ...]:
        """Names of the filled joints in canonical order."""
        return tuple(JOINTS[joint] for joint in sorted(self.rules))


def bind(rig: RigMap, hierarchy: Hierarchy) -> Binding:
    """Find the rig's joints in a file.

    Raises:
        ClipError: the file lacks a joint of the rig, or its fill rules need each other.
    """
    names: dict[str, int] = {}
    for index, name in enumerate(bare_names(hierarchy.joints)):
        names.setdefault(name, index)
    if missing := [name for name in rig.required if name.casefold() not in names]:
        raise ClipError(f"rig {rig.name} does not fit: the file has no joint {', '.join(missing)}")
    source = {INDEX[c]: names[s.casefold()] for c, s in rig.joints.items() if s.casefold() in names}
    waiting = {INDEX[c]: rule for c, rule in rig.filled.items() if INDEX[c] not in source}
    rules: dict[int, Fill] = {}
    while waiting:
        ready = [joint for joint, rule in waiting.items() if _needs(joint, rule) <= source.keys() | rules.keys()]
        if not ready:
            raise ClipError(f"rig {rig.name}: filled joint {JOINTS[min(waiting)]} needs itself")
        rules.update({joint: waiting.pop(joint) for joint in ready})
    return Binding(source, rules, names)


def _needs(joint: int, rule: Fill) -> set[int]:
    if rule.between is not None:
        return {INDEX[other] for other in rule.between}
    return {PARENTS[joint]} if rule.offset is not None else set()


def place(
    binding: Binding, hierarchy: Hierarchy, positions: Float64Array, world: Float64Array | None, scale: float
) -> Float64Array:
    """Canonical joints of measured ones and of the rules `between` and `end_site`.

    Args:
        binding: of the rig to the file.
        hierarchy: of the file.
        positions: [F, J, 3] of the file's joints in canonical axes, metres.
        world: [F, J, 4] of the file's joints in canonical axes, or None.
        scale: metres per file unit, for end sites.

    Returns:
        [F, 21, 3]; joints of the rule `offset` stand at their parent until `place_offsets` moves them.

    Raises:
        ClipError: an end site that the file has not.
    """
    placed = np.zeros((len(positions), len(JOINTS), 3))
    placed[:, list(binding.source)] = positions[:, list(binding.source.values())]
    for joint, rule in binding.rules.items():
        if rule.between is not None:
            first, second = (placed[:, INDEX[name]] for name in rule.between)
            placed[:, joint] = first + rule.at * (second - first)
        elif rule.end_site is not None:
            index, offset = _end_site(binding, hierarchy, rule.end_site)
            if world is None:
                raise ClipError(f"{JOINTS[joint]} needs the end site of {rule.end_site}, but the file has no rotations")
            placed[:, joint] = positions[:, index] + rotate(np.ascontiguousarray(world[:, index]), offset * scale)
        else:
            placed[:, joint] = placed[:, PARENTS[joint]]
    return placed


def place_offsets(binding: Binding, placed: Float64Array, world: Float64Array, height: float) -> None:
    """Move the joints of the rule `offset` in place.

    Args:
        binding: of the rig to the file.
        placed: [F, 21, 3] canonical joints.
        world: [F, 21, 4] their global rotations.
        height: body height in metres.
    """
    for joint, rule in binding.rules.items():
        if rule.offset is not None:
            parent = PARENTS[joint]
            offset = np.array(rule.offset) * height
            placed[:, joint] = placed[:, parent] + rotate(np.ascontiguousarray(world[:, parent]), offset)


def _end_site(binding: Binding, hierarchy: Hierarchy, name: str) -> tuple[int, Float64Array]:
    index = binding.names.get(name.casefold())
    for joint, offset in hierarchy.end_sites:
        if joint == index:
            return joint, np.array(offset)
    raise ClipError(f"joint {name} has no end site in this file")

"""The nodes of an FBX scene and how its animations place them, read through ufbx in a process of its own.

ufbx's binding is young: with a damaged file, or as a scene is let go, it may end the process that it runs in.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.own_process import read_apart, serve
from motionlake.formats.parse.placings import Placing, Placings
from motionlake.formats.parse.scene import check_room
from motionlake.formats.parse.scene_nodes import SceneHead, SceneNodes

LATE: Final = 0.1  # of a frame: how far after the end of an animation an instant may be
AT_KEY: Final = 1e-8  # seconds: how far from an instant a key may be and still be at it
_MISSING: Final = "needs ufbx: pip install 'motionlake[fbx]'"


# Scenes and their nodes: the binding frees some of them twice, so they are let go where the process ends.
_HELD: Final[list[Any]] = []


def read_nodes(data: bytes) -> SceneNodes:
    """The bones of a file and what is above them, metres, y up; every stack with two frames or more.

    Raises:
        ClipError: ufbx is not installed, cannot read the file or ends with it, or the file has no bones, no animation,
            or more than `limits` allow.
    """
    return SceneNodes.received(read_apart(__name__, "ufbx", data))


def _sent(data: bytes, folder: Path) -> list[memoryview]:
    """What the process of its own sends."""
    del folder
    try:
        import ufbx
    except ImportError as error:
        raise ClipError(_MISSING) from error
    try:
        scene = ufbx.load_memory(
            data,
            ignore_geometry=True,
            ignore_embedded=True,
            load_external_files=False,
            target_axes=ufbx.axes_right_handed_y_up,
            target_unit_meters=1.0,
            inherit_mode_handling=ufbx.InheritModeHandling.COMPENSATE_NO_FALLBACK,
        )
    except ufbx.UfbxError as error:
        raise ClipError(f"ufbx cannot read it: {' '.join(str(error).split())}") from error
    every = list(scene.nodes)
    _HELD.append((scene, every))
    nodes, parents, bones = _bones(every)
    rate = float(scene.settings.frames_per_second)
    if not 0 < rate < 1e6:
        raise ClipError(f"has a frame rate of {rate:g}")
    stacks = list(scene.anim_stacks)  # asked for once: the binding frees what a second list would hold
    spans = [_span(ufbx, scene, stack) for stack in stacks]
    frames = [int(min(max(end - begin, 0.0) * rate + LATE, 1e12)) + 1 for begin, end in spans]
    check_room((count, len(nodes)) for count in frames if count > 1)
    moved, names = [], []
    for stack, (begin, _), count in zip(stacks, spans, frames, strict=True):
        if count < 2:
            continue
        moved.append(_moved(ufbx, scene, stack.anim, nodes, begin + np.arange(count) / rate, rate))
        names.append(str(stack.name))
    if not moved:
        raise ClipError("has no animation of two frames or more")
    rest = Placings.of([_placing([node.local_transform]) for node in nodes])
    head = SceneHead(
        names=[str(node.name) for node in nodes],
        parents=parents,
        skeletons=[(found, str(nodes[found[0]].name)) for found in _skeletons(parents, bones)],
        rate=rate,
        takes=names,
        frames=[count for count in frames if count > 1],
        metres_per_unit=1.0,
        up="y",
    )
    unbound = np.full((len(nodes), 4, 4), np.nan)
    return SceneNodes(head, unbound, rest, moved).sent()


def _bones(nodes: Sequence[Any]) -> tuple[list[Any], list[int], list[int]]:
    """Of a scene's nodes the bones and what is above them, parents first: they, their parents, and which are bones."""
    by_id = {node.typed_id: node for node in nodes}
    kept: dict[int, int] = {}
    parents: list[int] = []

    def keep(key: int) -> None:
        chain: list[int] = []
        here: Any = by_id[key]
        while here is not None and here.typed_id not in kept and len(chain) <= len(nodes):
            chain.append(here.typed_id)
            here = here.parent
        for each in reversed(chain):
            above = by_id[each].parent
            parents.append(-1 if above is None else kept[above.typed_id])
            kept[each] = len(kept)

    bones = [node.typed_id for node in nodes if node.bone is not None]
    if not bones:
        raise ClipError("has no bones")
    limits().check("joints", len(bones), f"has {len(bones)} joints")
    for bone in bones:
        keep(bone)
    return [by_id[key] for key in kept], parents, [kept[bone] for bone in bones]


def _skeletons(parents: Sequence[int], bones: Sequence[int]) -> list[list[int]]:
    """Bones that hang from one bone."""
    top: dict[int, int] = {}
    found: dict[int, list[int]] = {}
    known = set(bones)
    for node, parent in enumerate(parents):  # parents first
        above = top.get(parent, -1)
        top[node] = node if above < 0 and node in known else above
        if node in known:
            found.setdefault(top[node], []).append(node)
    return list(found.values())


def _span(ufbx: Any, scene: Any, stack: Any) -> tuple[float, float]:
    """When an animation begins and ends, seconds; by its keys where the stack does not say."""
    if stack.time_end > stack.time_begin:
        return float(stack.time_begin), float(stack.time_end)
    baked = ufbx.bake_anim(scene, stack.anim)
    return float(baked.key_time_min), float(baked.key_time_max)


def _moved(ufbx: Any, scene: Any, anim: Any, nodes: Sequence[Any], times: Float64Array, rate: float) -> Placings:
    """How an animation places nodes at instants: by the keys that ufbx bakes, where all of these have one.

    Baking takes a fifth of the time of asking for one node at one instant after the other.
    """
    baked = ufbx.bake_anim(scene, anim, resample_rate=rate)
    keyed = {node.typed_id: node for node in baked.nodes}
    _HELD.append((baked, keyed))
    placings = []
    for node in nodes:
        moves = node.typed_id in keyed
        found = _of_keys(keyed[node.typed_id], times) if moves else None
        if found is None:
            instants = times.tolist() if moves else times[:1].tolist()
            found = _placing([ufbx.evaluate_transform(anim, node, time) for time in instants])
        placings.append(found)
    return Placings.of(placings)


def _of_keys(node: Any, times: Float64Array) -> Placing | None:
    """How a baked node is placed; None where there is no key at one of the instants."""
    parts = []
    for baked in (node.translation_keys, node.rotation_keys, node.scale_keys):
        keys = list(baked)
        if not keys:
            return None
        values = np.fromiter(chain.from_iterable([key.value for key in keys]), np.float64).reshape(len(keys), -1)
        if (values == values[0]).all():
            values = values[:1]
        else:
            key_times = np.array([key.time for key in keys])
            at = np.minimum(np.searchsorted(key_times, times - AT_KEY), len(keys) - 1)
            if not (np.abs(key_times[at] - times) <= AT_KEY).all():
                return None
            values = values[at]
        parts.append(values)
    translation, rotation, scale = parts
    return Placing(translation, rotation[:, [3, 0, 1, 2]], scale)


def _placing(transforms: Sequence[Any]) -> Placing:
    """Of ufbx's transforms."""
    moves, turns, sizes = zip(*((t.translation, t.rotation, t.scale) for t in transforms), strict=True)
    return Placing(np.array(moves), np.array(turns)[:, [3, 0, 1, 2]], np.array(sizes))


if __name__ == "__main__":
    serve(_sent, partial(importlib.import_module, "ufbx"))

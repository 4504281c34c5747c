"""The nodes of an FBX scene and how its animations place them, read through ufbx in a process of its own.

ufbx's binding is young: with a damaged file, or as a scene is let go, it may end the process that it runs in. So a
child reads the file, sends what it found as arrays, and ends at once; whatever happens to it is a reason to reject the
file and nothing else.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import MIB, Limits, limits, within
from motionlake.formats.parse.scene import Placing, check_room

LATE: Final = 0.1  # of a frame: how far after the end of an animation an instant may be
_MISSING: Final = "needs ufbx: pip install 'motionlake[fbx]'"
_OWN_BYTES: Final = 1024 * MIB  # address space that Python and its libraries take
_PLACING: Final = 10  # translation, rotation (w, x, y, z), scale
_ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


@dataclass(frozen=True)
class FbxNodes:
    """The N nodes of a scene that are bones or above bones, metres, y up.

    Attributes:
        names: of the nodes.
        parents: of each its parent, -1 at the top; parents come first.
        bones: which of them are bones.
        rate: frames a second.
        stacks: names of the animation stacks with two frames or more.
        rest: how each node rests.
        moved: for each stack, for each node, how it is placed in F frames.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    bones: tuple[int, ...]
    rate: float
    stacks: tuple[str, ...]
    rest: tuple[Placing, ...]
    moved: tuple[tuple[Placing, ...], ...]


# Scenes and their nodes: the binding frees some of them twice, so they are let go where the process ends.
_HELD: Final[list[Any]] = []


def read_nodes(data: bytes) -> FbxNodes:
    """The nodes of a file.

    Raises:
        ClipError: ufbx is not installed, cannot read the file or ends with it, or the file has no bones, no animation,
            or more than `limits` allow.
    """
    try:
        ran = subprocess.run(
            [sys.executable, "-P", "-m", __name__, json.dumps(asdict(limits()))],
            input=data, capture_output=True, check=False,
            timeout=limits().seconds or None, env=os.environ | _ONE_THREAD,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise ClipError(f"took more than {limits().seconds} s to read; [limits] seconds in config.toml") from error
    if ran.returncode == 1 and ran.stderr.startswith(b"reason: "):
        raise ClipError(ran.stderr.decode("utf-8", "replace").splitlines()[0].removeprefix("reason: "))
    if ran.returncode:
        raise ClipError("ufbx cannot read it: it ended while it read the file")
    return _received(ran.stdout)


def _received(sent: bytes) -> FbxNodes:
    """Of a line of JSON and the numbers [1 + all frames, N, 10] after it: the rest pose, then each stack."""
    line, _, rest = sent.partition(b"\n")
    head = json.loads(line)
    nodes = len(head["names"])
    numbers = np.frombuffer(rest, np.float64).reshape(-1, nodes, _PLACING)
    ends = np.cumsum([1, *head.pop("frames")])
    first, *stacks = np.split(numbers, ends[:-1])
    placings = [tuple(_placing(part[:, node]) for node in range(nodes)) for part in (first, *stacks)]
    return FbxNodes(
        names=tuple(head["names"]),
        parents=tuple(head["parents"]),
        bones=tuple(head["bones"]),
        rate=head["rate"],
        stacks=tuple(head["stacks"]),
        rest=placings[0],
        moved=tuple(placings[1:]),
    )


def _placing(numbers: Float64Array) -> Placing:
    """Of [F, 10] numbers."""
    return Placing(numbers[:, :3], numbers[:, 3:7], numbers[:, 7:])


def _sent(data: bytes) -> bytes:
    """The other side of `_received`."""
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
        evaluate, anim = ufbx.evaluate_transform, stack.anim
        times = (begin + np.arange(count) / rate).tolist()
        moved.append(np.stack([_numbers([evaluate(anim, node, time) for time in times]) for node in nodes], axis=1))
        names.append(str(stack.name))
    if not moved:
        raise ClipError("has no animation of two frames or more")
    rest = np.stack([_numbers([node.local_transform]) for node in nodes], axis=1)
    head = {
        "names": [str(node.name) for node in nodes],
        "parents": parents,
        "bones": bones,
        "rate": rate,
        "stacks": names,
        "frames": [len(each) for each in moved],
    }
    return json.dumps(head).encode() + b"\n" + np.concatenate([rest, *moved]).tobytes()


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


def _span(ufbx: Any, scene: Any, stack: Any) -> tuple[float, float]:
    """When an animation begins and ends, seconds; by its keys where the stack does not say."""
    if stack.time_end > stack.time_begin:
        return float(stack.time_begin), float(stack.time_end)
    baked = ufbx.bake_anim(scene, stack.anim)
    return float(baked.key_time_min), float(baked.key_time_max)


def _numbers(transforms: Sequence[Any]) -> Float64Array:
    """[F, 10] of ufbx's transforms."""
    rows = [
        (
            t.translation.x, t.translation.y, t.translation.z,
            t.rotation.w, t.rotation.x, t.rotation.y, t.rotation.z,
            t.scale.x, t.scale.y, t.scale.z,
        )
        for t in transforms
    ]  # fmt: skip
    return np.array(rows, np.float64).reshape(-1, _PLACING)


def _bound_memory(most: int) -> None:
    try:
        import resource
    except ImportError:  # where there is none, the limit of the worker holds
        return
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _child() -> None:
    """Read a file from standard input and write what was found, or the reason, and end without letting it go."""
    allowed = Limits(**json.loads(sys.argv[1]))
    _bound_memory(_OWN_BYTES + allowed.memory_megabytes * MIB)
    try:
        with within(allowed):
            sys.stdout.buffer.write(_sent(sys.stdin.buffer.read()))
        sys.stdout.buffer.flush()
        os._exit(0)
    except ClipError as error:
        print(f"reason: {error.reason}", file=sys.stderr, flush=True)
    except MemoryError:
        most = allowed.memory_megabytes
        reason = f"needs more than {most} MiB of memory; [limits] memory_megabytes = {most} in config.toml"
        print(f"reason: {reason}", file=sys.stderr, flush=True)
    os._exit(1)


if __name__ == "__main__":
    _child()

"""Rig maps: which joint of a file is which canonical joint, as data (one TOML file a rig)."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import cache, cached_property, lru_cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, Final

from motionlake.errors import ClipError, UserError
from motionlake.motion.clip import Hierarchy
from motionlake.motion.skeleton import JOINTS, TWIST_AXES

UP_AXES: Final = ("x", "y", "z", "-x", "-y", "-z")
MAX_LISTED: Final = 8
# A prefix such as "Character1_" is a namespace where this share of the joints has it.
NAMESPACE_SHARE: Final = 0.8


class Rest(StrEnum):
    """Where a rig's rest pose comes from."""

    ZERO = "zero"  # the file's zero pose is a human in a standing pose
    ORIENTATIONS = "orientations"  # the map gives each joint's orientation in the canonical T-pose
    POSITIONS = "positions"  # rotations are derived from positions only
    CANONICAL = "canonical"  # the zero pose is the canonical rest pose by definition


@dataclass(frozen=True)
class Fill:
    """How a canonical joint that the rig lacks is placed; it turns with its parent. One rule is set.

    Attributes:
        between: two canonical joints and the share `at` of the way from the first to the second.
        end_site: source joint whose first end site is the place.
        offset: share of the body height along the canonical x, y, z, carried by the parent joint.
    """

    between: tuple[str, str] | None = None
    at: float = 0.5
    end_site: str | None = None
    offset: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class RigMap:
    """A rig: joint names of the source and what they mean.

    Attributes:
        name, description, source: what it is called, what it is, where its names come from.
        up: up axis of the files by default, one of x y z -x -y -z.
        metres_per_unit: length unit of the files by default; None: the file must say it, or the user.
        rest: where the rest pose comes from.
        joints: canonical joint -> source joint.
        filled: canonical joint -> rule. A joint that is in `joints` too is filled where the file lacks it.
        known: further joints that files of this rig have.
        rest_orientations: source joint -> global rotation (w, x, y, z) when the body stands in the canonical
            T-pose; a joint that is not listed has its parent's.
        twists: canonical joint -> degrees about its bone's canonical direction that the rest pose is turned
            by, so that hinges agree between rigs: elbows bend straight forward from the T-pose, toes up.
    """

    name: str
    description: str
    source: str
    up: str
    metres_per_unit: float | None
    rest: Rest
    joints: Mapping[str, str]
    filled: Mapping[str, Fill] = field(default_factory=dict)
    known: tuple[str, ...] = ()
    rest_orientations: Mapping[str, tuple[float, float, float, float]] = field(default_factory=dict)
    twists: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def required(self) -> tuple[str, ...]:
        """Source joints that a file of this rig must have."""
        return tuple(source for joint, source in self.joints.items() if joint not in self.filled)


def load_rigs(folder: Path | None = None) -> dict[str, RigMap]:
    """The rig maps of the package and those of `folder` (a folder that is absent holds none), by name.

    Raises `UserError` where a TOML file of `folder` is no rig map.
    """
    shipped = resources.files("motionlake.motion").joinpath("rigs").iterdir()
    files = [(file.name, file) for file in shipped if file.name.endswith(".toml")]
    if folder is not None:
        files += [(str(file), file) for file in sorted(folder.glob("*.toml"))]
    rigs = [_parsed(_text(file, origin), origin) for origin, file in files]
    return {rig.name: rig for rig in rigs}


@cache
def _parsed(text: str, origin: str) -> RigMap:
    """`parse_rig`, once a process: to read all maps takes as long as a clip."""
    return parse_rig(text, origin)


def _text(file: Traversable, origin: str) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise UserError(f"rig map {origin}: is not UTF-8 ({error.reason}); save it as UTF-8") from error


def parse_rig(text: str, origin: str) -> RigMap:
    """A rig map from TOML text; `origin` names it in errors.

    Raises:
        UserError: not TOML, a key that is missing or unknown, or a canonical joint without a source.
    """
    try:
        table = tomllib.loads(text)
        unknown = sorted(table.keys() - {key.name for key in fields(RigMap)})
        if unknown:
            raise ValueError(f"unknown key {unknown[0]!r}")
        rig = _rig(table)
        _check(rig)
    except KeyError as error:
        raise UserError(f"rig map {origin}: no key {error}; see docs/skeletons.md") from error
    except (TypeError, ValueError, AttributeError) as error:
        raise UserError(f"rig map {origin}: {error}; see docs/skeletons.md") from error
    return rig


def _rig(table: dict[str, Any]) -> RigMap:
    unit = table["metres_per_unit"]
    return RigMap(
        name=str(table["name"]),
        description=str(table.get("description", "")),
        source=str(table.get("source", "")),
        up=str(table.get("up", "y")),
        metres_per_unit=None if unit == "file" else float(unit),
        rest=Rest(table.get("rest", "zero")),
        joints={joint: str(source) for joint, source in table["joints"].items()},
        filled={joint: _fill(rule) for joint, rule in table.get("filled", {}).items()},
        known=tuple(str(name) for name in table.get("known", {}).get("others", [])),
        rest_orientations={joint: _unit_quaternion(q) for joint, q in table.get("rest_orientations", {}).items()},
        twists={joint: float(degrees) for joint, degrees in table.get("twists", {}).items()},
    )


def _fill(rule: dict[str, Any]) -> Fill:
    match sorted(rule):
        case ["at", "between"]:
            first, second = rule["between"]
            return Fill(between=(str(first), str(second)), at=float(rule["at"]))
        case ["end_site"]:
            return Fill(end_site=str(rule["end_site"]))
        case ["offset"]:
            x, y, z = rule["offset"]
            return Fill(offset=(float(x), float(y), float(z)))
    raise ValueError(f"a filled joint needs between and at, or end_site, or offset, not {sorted(rule)}")


def _unit_quaternion(values: Sequence[float]) -> tuple[float, float, float, float]:
    w, x, y, z = (float(value) for value in values)
    length = (w * w + x * x + y * y + z * z) ** 0.5
    if abs(length - 1) > 1e-3:
        raise ValueError(f"rest orientation {list(values)} is no unit quaternion")
    return w / length, x / length, y / length, z / length


def _check(rig: RigMap) -> None:
    covered = set(rig.joints) | set(rig.filled)
    if missing := [joint for joint in JOINTS if joint not in covered]:
        raise ValueError(f"canonical joint {missing[0]} is neither under [joints] nor under [filled]")
    references = [joint for rule in rig.filled.values() for joint in rule.between or ()]
    if strange := sorted((covered | set(references) | set(rig.twists)) - set(JOINTS)):
        raise ValueError(f"{strange[0]!r} is no canonical joint; they are {', '.join(JOINTS)}")
    if "hips" not in rig.joints:
        raise ValueError("hips must be a joint of the file")
    if rig.up not in UP_AXES:
        raise ValueError(f"up is {rig.up!r}, not one of {', '.join(UP_AXES)}")
    if rig.metres_per_unit is not None and not rig.metres_per_unit > 0:
        raise ValueError(f"metres_per_unit is {rig.metres_per_unit}, not positive")
    if twice := [name for name, count in Counter(rig.joints.values()).items() if count > 1]:
        raise ValueError(f"source joint {twice[0]!r} stands for two canonical joints")
    if stiff := sorted(set(rig.twists) - set(TWIST_AXES)):
        raise ValueError(f"{stiff[0]} bears no single bone to twist about")
    if circular := [joint for joint, rule in rig.filled.items() if joint in (rule.between or ())]:
        raise ValueError(f"{circular[0]} is filled from itself")


def bare_names(joint_names: Sequence[str]) -> list[str]:
    """Names without namespaces ("mixamorig:Hips", "Character1_Hips" -> "hips"), lower case."""
    names = [re.split(r"[:|]", name)[-1] for name in joint_names]
    prefixes = Counter(name.split("_", 1)[0] for name in names if "_" in name)
    if prefixes and len(names) > 1:
        prefix, count = prefixes.most_common(1)[0]
        if count >= NAMESPACE_SHARE * len(names):
            names = [name.removeprefix(f"{prefix}_") for name in names]
    return [name.casefold() for name in names]


def joints_by_name(joint_names: Sequence[str]) -> dict[str, int]:
    """Index of each joint of a file by the names that a rig map may call it by: with its namespace and without, lower
    case. A joint that is called so in full comes before one that is so within a namespace; of two it is the first."""
    return dict(_by_name(tuple(joint_names)))


@lru_cache(maxsize=64)  # the files of a folder are of few rigs
def _by_name(joint_names: tuple[str, ...]) -> Mapping[str, int]:
    found: dict[str, int] = {}
    for names in ([name.casefold() for name in joint_names], bare_names(joint_names)):
        for index, name in enumerate(names):
            found.setdefault(name, index)
    return found


def identify(joint_names: Sequence[str], rigs: Mapping[str, RigMap], name: str | None = None) -> RigMap:
    """The rig whose required joints the file has all, and that explains most of its other joints.

    Args:
        joint_names: as the file spells them; namespaces and letter case are ignored.
        rigs: maps to choose from, by name.
        name: take this map where it fits.

    Raises:
        UserError: there is no map called `name`.
        ClipError: no map fits; the reason says what did not match, of the one called `name` where it is given.
    """
    if name is not None and name not in rigs:
        raise UserError(f"--rig {name}: no such rig; there are {', '.join(sorted(rigs))}")
    present = joints_by_name(joint_names)
    lacked = {rig.name: [s for s in rig.required if s.casefold() not in present] for rig in rigs.values()}
    fitting = [rig for rig in rigs.values() if not lacked[rig.name]]
    if name is not None and not lacked[name]:
        return rigs[name]
    if fitting:
        return min(fitting, key=lambda rig: (_unexplained(rig, present), rig.name))
    candidates = list(rigs.values()) if name is None else [rigs[name]]
    closest = min(candidates, key=lambda rig: (len(lacked[rig.name]) / len(rig.required), rig.name))
    missing = lacked[closest.name]
    more = f" and {len(missing) - MAX_LISTED} more" if len(missing) > MAX_LISTED else ""
    listed = ", ".join(missing[:MAX_LISTED]) + more
    if name is not None:
        raise ClipError(f"rig {name} does not fit: the file has no joint {listed}")
    raise ClipError(
        f"unknown rig: the closest known one is {closest.name}, but the file lacks its joints {listed}; "
        "`motionlake rig FILE` prints a rig map to edit"
    )


def placeable(hierarchy: Hierarchy, rigs: Mapping[str, RigMap]) -> dict[str, RigMap]:
    """The maps, by name, whose filled joints a file has room for: each `end_site` is there, or the joint itself is.

    A body whose foot goes on in a joint of another name has no end site there, and is of another rig.
    """
    present = joints_by_name(hierarchy.joints)
    ended = {joint for joint, _ in hierarchy.end_sites}

    def is_placed(rig: RigMap, joint: str, rule: Fill) -> bool:
        if rule.end_site is None or rig.joints.get(joint, "").casefold() in present:
            return True
        return present.get(rule.end_site.casefold()) in ended

    return {
        name: rig
        for name, rig in rigs.items()
        if all(is_placed(rig, joint, rule) for joint, rule in rig.filled.items())
    }


def _unexplained(rig: RigMap, present: Mapping[str, int]) -> int:
    """How many of the joints present (`joints_by_name`) the rig map does not name."""
    named = {present.get(source.casefold()) for source in (*rig.joints.values(), *rig.known)}
    return len(set(present.values()) - named)

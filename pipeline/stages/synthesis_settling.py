"""What a request of new motion comes to: its seconds and its speed, or a line that says what does not fit together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from motionlake.errors import UserError
from motionlake.glogen.config import AUTO, MATCHING
from motionlake.lake.catalog import Connection
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.stages.generator_model import labelled_rows, recipe_of
from motionlake.stages.synthesis import Chosen, check_classes, chosen_generator
from motionlake.stages.synthesis_control import Request, check_request
from motionlake.stages.synthesis_options import path_of

if TYPE_CHECKING:
    from motionlake.lake.models import Model
    from motionlake.motion.paths import GroundPath

USUAL: Final = 2.0  # seconds of a class of which the lake has no recording, where others say theirs
SECONDS: Final = 8.0  # of a motion for which nothing says how long it is
ASIDE: Final = 0.05  # share of a class's frames that go sideways or back, with which it can face elsewhere
LEAST_LOOP: Final = 2.0  # seconds
NEAR: Final = 0.2  # metres between keyframes that any class gets over
STAYING: Final = 1.5  # metres a second that a class goes at most which mostly stays where it is
# Of the slowest and the fastest of a class, how slow and fast it may be asked to go.
SLOWER, FASTER = 0.7, 1.3


def check_recipe(request: Request, recipe: str, asked: str) -> None:
    """Raises `UserError` where a generator's recipe cannot do what a request says of time and way.

    Args:
        request: as it was asked.
        recipe: of the generator.
        asked: that config.toml says.
    """
    if recipe == MATCHING:
        return
    wanted = {
        "follows no path": request.path is not None, "keeps no speed": request.speed is not None,
        "keeps facing nothing": request.facing is not None, "makes no loops": request.loop,
        "does not go on from the end of a clip": request.from_end,
        "gives every class an equal share of the time": request.shares is not None,
        "makes no range of a clip anew": request.edited is not None,
        "takes no style from a clip": request.style is not None,
    }  # fmt: skip
    cannot = next((said for said, given in wanted.items() if given), None)
    if cannot is None:
        return
    names = ", ".join(dict.fromkeys(request.classes))
    how = f"label recordings of {names} in labels.csv (ranges in segments.csv), `motionlake ingest`"
    if asked != AUTO:
        how = f'set [synthesis] recipe = "{AUTO}" in config.toml'
    raise UserError(f'recipe "{recipe}" {cannot}; "{MATCHING}" can: {how}, then `motionlake run synth`')


def settle(con: Connection, lake: Lake, config: LakeConfig, request: Request) -> tuple[Chosen, Request]:
    """The generator that makes a request, and the request with its seconds and its speed.

    Raises:
        UserError: as `chosen_generator` and `settled`.
    """
    chosen = chosen_generator(con, lake, config, request.classes)
    asked = _timed(request, {row["label"]: row["seconds"] for row in labelled_rows(con)})
    return chosen, settled(asked, chosen.model, config.synthesis.recipe)


def _timed(request: Request, usual: Mapping[str, float]) -> Request:
    """The request with the seconds of every class, where it says those of some: the others share what is left of its
    seconds, or last as long as their recordings do."""
    if request.shares is None or None not in request.shares:
        return request
    open_ended = [n for n, time in zip(request.classes, request.shares, strict=True) if time is None]
    lengths = {name: usual.get(name, USUAL) for name in open_ended}
    if request.seconds is not None:
        left = request.seconds - sum(time for time in request.shares if time is not None)
        if left <= 0:
            raise UserError(f"--seconds {request.seconds:g} leaves no time for {', '.join(open_ended)}")
        lengths = dict.fromkeys(open_ended, left / len(open_ended))
    filled = zip(request.classes, request.shares, strict=True)
    return replace(request, shares=tuple(lengths[name] if time is None else time for name, time in filled))


def settled(request: Request, model: Model, asked: str = AUTO) -> Request:
    """The request with its seconds and its speed.

    Args:
        request: as it was asked.
        model: the generator; its metric `speeds` has of each class the slowest, the usual and the fastest, metres a
            second.
        asked: the recipe that config.toml says.

    Raises:
        UserError: no motion can have its numbers; the recipe or a class cannot do what it says, or this does not fit
            together: a path that leaves no time, a class that goes nowhere.
    """
    check_request(request)
    check_classes(model, request.classes)
    check_recipe(request, recipe_of(model), asked)
    _check_together(request)
    speeds = model.metrics.get("speeds", {})
    if request.keyframes:
        _check_ways(request, [speeds[name] for name in request.classes if name in speeds])
        return request
    aside = model.metrics.get("aside", {}).get(request.classes[0], 0.0)
    if request.facing is not None and aside < ASIDE:
        raise UserError(
            f"{request.classes[0]} was recorded going ahead alone: it can only face its way (--facing path)"
        )
    rates = speeds.get(request.classes[0])
    seconds = sum(request.parts) if request.parts is not None else request.seconds
    if request.path is None:
        return _within(replace(request, seconds=SECONDS if seconds is None else seconds), rates)
    return _within(_along(replace(request, seconds=seconds), path_of(request.path), rates), rates)


def _along(request: Request, path: GroundPath, rates: Sequence[float] | None) -> Request:
    """The request with the seconds and the speed by which it follows a path."""
    if len(set(request.classes)) > 1 and request.speed is None:
        if request.seconds is None:
            raise UserError("several classes along a path: say how long each lasts, --class walk:3 --class run:2")
        return request
    if request.speed is None and rates is None:
        raise UserError(f"class {request.classes[0]} stays where it is; to have it follow a path, give --speed")
    usual = request.speed or (rates[1] if rates else 0.0)
    if request.seconds is None:
        return replace(request, seconds=path.length / usual, speed=usual)
    if request.speed is not None:
        return request
    rounds = request.seconds * usual / path.length if path.closed else 1.0
    if request.loop:
        rounds = max(1, round(rounds))
    return replace(request, speed=rounds * path.length / request.seconds)


def _check_ways(request: Request, rates: Sequence[Sequence[float] | None]) -> None:
    """Raises `UserError` where no class goes so fast as its keyframes are apart."""
    fastest = max((STAYING if rate is None else FASTER * rate[2] for rate in rates), default=math.inf)
    for before, after in pairwise(request.keyframes):
        metres = math.hypot(*(after.hips[i] - before.hips[i] for i in (0, 2)))
        seconds = after.seconds - before.seconds
        if metres > NEAR and metres / seconds > fastest:
            raise UserError(
                f"{metres:.1f} m from {before.name} to {after.name} leave no time: {', '.join(request.classes)} goes "
                f"{fastest:.2g} m/s at most, which takes {metres / fastest:.1f} s, not {seconds:.2g}"
            )


def _check_together(request: Request) -> None:
    if request.keyframes:
        _check_alone(request)
    if request.parts is not None and request.seconds is not None:
        total = sum(request.parts)
        if not math.isclose(total, request.seconds):
            raise UserError(f"the classes last {total:g} seconds together, and --seconds says {request.seconds:g}")
    if request.speed is not None and not (request.speed > 0 and math.isfinite(request.speed)):
        raise UserError(f"speed {request.speed:g}: must be more than 0 metres a second")
    if request.facing is not None and request.path is None:
        raise UserError("--facing says where a body faces along a path: give --path")
    if request.pace != 1.0 and (request.path is not None or request.speed is not None):
        raise UserError("along a path, or with --speed, metres a second say how fast: leave --pace out")
    if request.loop and request.from_end:
        raise UserError("a motion that goes on from a clip (--continue) does not end where it began (--loop)")
    if request.loop and request.path is not None and not path_of(request.path).closed:
        raise UserError("a loop needs a path that ends where it begins")
    lasts = sum(request.parts) if request.parts is not None else request.seconds
    if request.loop and lasts is not None and lasts < LEAST_LOOP:
        raise UserError(f"a loop of {lasts:g} seconds: ask for {LEAST_LOOP:g} at least")


def _check_alone(request: Request) -> None:
    """Raises `UserError` for what keyframes, or the rest of an edited clip, say already."""
    what = "keyframes say" if request.edited is None else "the rest of the clip says"
    told = {
        "--path": request.path is not None, "--speed": request.speed is not None,
        "--facing": request.facing is not None,
        "--loop": request.loop, "--continue": request.from_end, "--split": request.split is not None,
        "--style-from": request.style is not None,
        "seconds of classes": request.shares is not None, "--pace": request.pace != 1.0,
    }  # fmt: skip
    other = next((name for name, given in told.items() if given), None)
    if other is not None:
        raise UserError(f"{what} where a motion goes and when: leave {other} out")


def _within(request: Request, rates: Sequence[float] | None) -> Request:
    """The request, where its class goes as fast as it asks."""
    if rates is None or request.speed is None:
        return request
    slow, fast = SLOWER * rates[0], FASTER * rates[2]
    if slow <= request.speed <= fast:
        return request
    metres = request.speed * request.lasts
    needs = f"{metres / fast:.1f} to {metres / max(slow, 1e-3):.1f} seconds"
    way = f"; {metres:.1f} m need {needs}" if request.path is not None else ""
    raise UserError(f"{request.classes[0]} goes {slow:.2g} to {fast:.2g} m/s as recorded, not {request.speed:.3g}{way}")

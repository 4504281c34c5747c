"""Requests of new motion: what they may say, of time and way too (seconds of a class, a path, a speed, a loop)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from motionlake.errors import UserError
from motionlake.glogen.config import AUTO, MATCHING
from motionlake.stages.generator_model import recipe_of
from motionlake.stages.synthesis import check_classes
from motionlake.stages.synthesis_options import path_of

if TYPE_CHECKING:
    from motionlake.lake.models import Model
    from motionlake.motion.paths import GroundPath

# Of a request: what its starts are drawn from; and what was added since motions were first kept, by its default.
DRAWN: Final = ("start", "outside", "split", "min_quality")
ADDED: Final[dict[str, Any]] = {
    "shares": None, "path": None, "speed": None, "facing": None, "loop": False, "from_end": False, "keyframes": (),
    "rate": None, "edited": None, "diverse": False, "style": None,
}  # fmt: skip
SECONDS: Final = 8.0  # of a motion for which nothing says how long it is
ASIDE: Final = 0.05  # share of a class's frames that go sideways or back, with which it can face elsewhere
LEAST_LOOP: Final = 2.0  # seconds
# Of the slowest and the fastest of a class, how slow and fast it may be asked to go.
SLOWER, FASTER = 0.7, 1.3
NEAR: Final = 0.2  # metres between keyframes that any class gets over
STAYING: Final = 1.5  # metres a second that a class goes at most which mostly stays where it is
LONGEST: Final = 3600.0  # seconds of one motion


@dataclass(frozen=True)
class Keyframe:
    """A pose that a motion passes through: of which frame of which clip, when, and the pose in the motion's world.

    Attributes:
        clip: name, or path of a file.
        frame: of it.
        seconds: from the first keyframe.
        hips: [3] metres.
        rotations: [21 x 4] local.
    """

    clip: str
    frame: int
    seconds: float
    hips: tuple[float, ...]
    rotations: tuple[float, ...]

    @property
    def name(self) -> str:
        return f"{self.clip}@{self.frame}"


@dataclass(frozen=True)
class StyleClip:
    """A clip of the lake, or a clip file (`outside`, its path), that motion is to look like; where it is kept."""

    clip: str
    dataset: str
    part: str
    fps: float
    rest_offsets: tuple[float, ...]
    content_hash: str
    outside: bool = False


@dataclass(frozen=True)
class Request:
    """Motions to make.

    Attributes:
        classes: one after the other in each motion, equal shares of the time.
        seconds: of each motion; None: as long as classes or path say.
        seed: of what is drawn; every motion is drawn for itself, so that it does not depend on how many are made.
        start: recorded clip that all start from, or with `outside` a clip file that need not be in the lake (its first
            body); None draws a clip of the first class for each.
        outside: `start` is the path of a file.
        split: draws from this split only.
        pace: 2 is twice as fast.
        temperature: of the latent variables: 0 for the likeliest motion, 1 as recordings vary.
        min_quality: the worst verdict of stage "quality" that a clip may have that is drawn; None: any.
        shares: seconds of each class; None: equal shares of the time.
        path: on the ground (`path_text`); None: as recordings go.
        speed: metres a second; None: that of the class.
        facing: degrees to the left of the heading at the start that the body keeps facing; None: along its way.
        loop: the end of a motion meets its beginning.
        from_end: it goes on from the last frames of `start`, not from its first.
        keyframes: poses that it passes through (`synthesis_keys`); it lasts from the first to the last.
        rate: frames a second of a motion through keyframes, or of an edited clip; None: those of the generator.
        edited: frames [first, stop) of `start` that are made anew; the motion is the whole clip then.
        diverse: none of the motions is nearer to another than recorded clips of the class are (`synthesis_diversity`).
        style: frames that look like those of this clip are preferred.
    """

    classes: tuple[str, ...]
    seconds: float | None
    seed: int = 0
    start: str | None = None
    outside: bool = False
    split: str | None = None
    pace: float = 1.0
    temperature: float = 1.0
    min_quality: str | None = None
    shares: tuple[float, ...] | None = None
    path: str | None = None
    speed: float | None = None
    facing: float | None = None
    loop: bool = False
    from_end: bool = False
    keyframes: tuple[Keyframe, ...] = ()
    rate: float | None = None
    edited: tuple[int, int] | None = None
    diverse: bool = False
    style: StyleClip | None = None

    @property
    def lasts(self) -> float:
        """Seconds of each motion, once they are settled."""
        assert self.seconds is not None, "the request is not settled"
        return self.seconds


def check_request(request: Request) -> None:
    """Raises `UserError` for numbers that no motion can have."""
    if request.seconds is not None and not 0 < request.seconds <= LONGEST:
        raise UserError(f"{request.seconds:g} seconds: ask for more than 0, and at most {LONGEST:g}")
    if not (request.pace > 0 and math.isfinite(request.pace)):
        raise UserError(f"pace {request.pace:g}: must be more than 0; 1 is as recorded, 2 twice as fast")
    if not (request.temperature >= 0 and math.isfinite(request.temperature)):
        raise UserError(f"temperature {request.temperature:g}: must be 0 or more; 0 gives the likeliest motion")
    if request.seed < 0:
        raise UserError(f"seed {request.seed}: must be 0 or more")
    if request.start is not None and request.split is not None:
        raise UserError("a motion starts from one clip (--from) or from those of a split (--split): leave one out")


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
    how = f"label recordings of {', '.join(dict.fromkeys(request.classes))} in labels.csv (ranges in segments.csv), `motionlake ingest`"
    if asked != AUTO:
        how = f'set [synthesis] recipe = "{AUTO}" in config.toml'
    raise UserError(f'recipe "{recipe}" {cannot}; "{MATCHING}" can: {how}, then `motionlake run synth`')


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
    seconds = sum(request.shares) if request.shares is not None else request.seconds
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
    if request.shares is not None and request.seconds is not None:
        total = sum(request.shares)
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
    lasts = sum(request.shares) if request.shares is not None else request.seconds
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


def controls(request: Request) -> dict[str, Any]:
    """What a request says of time and way beside its seconds; what it does not ask for is left out."""
    found = added(request)
    if request.style is not None:
        found["style"] = request.style.clip
    if request.keyframes:
        found["keyframes"] = [f"{key.name}={key.seconds:g}" for key in request.keyframes]
    return found


def added(request: Request) -> dict[str, Any]:
    """What a request asks for beside classes, length, seed, pace and temperature."""
    return {name: value for name, value in asdict(request).items() if name in ADDED and value != ADDED[name]}


def marked(request: Request) -> dict[str, Any]:
    """What tells a request from others of the same classes and seed: what is added, and what it starts from.

    Keyframes, and a range of a clip, name what they start from themselves.
    """
    own = () if request.keyframes else DRAWN
    drawn = {name: value for name in own if (value := getattr(request, name)) not in (None, False)}
    return added(request) | drawn


def shaping(request: Request) -> dict[str, Any]:
    """What of a request its motions follow from, beside what they start from; without what it does not ask for, so that
    motions keep their keys."""
    of_old = {k: value for k, value in asdict(request).items() if k not in DRAWN and k not in ADDED}
    return of_old | added(request)

"""Requests of new motion: what they may say, of time and way too (seconds of a class, a path, a speed, a loop)."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

from motionlake.errors import UserError

if TYPE_CHECKING:
    pass

# Of a request: what its starts are drawn from; and what was added since motions were first kept, by its default.
DRAWN: Final = ("start", "outside", "split", "min_quality")
ADDED: Final[dict[str, Any]] = {
    "shares": None, "path": None, "speed": None, "facing": None, "loop": False, "from_end": False, "keyframes": (),
    "rate": None, "edited": None, "diverse": False, "style": None,
}  # fmt: skip
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
        shares: seconds of each class, None of one that lasts as long as its recordings do; None: equal shares of the
            time.
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
    shares: tuple[float | None, ...] | None = None
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
    def parts(self) -> tuple[float, ...] | None:
        """Seconds of each class, once they are settled; None: equal shares of the time."""
        if self.shares is None:
            return None
        found = tuple(seconds for seconds in self.shares if seconds is not None)
        assert len(found) == len(self.shares), "the request is not settled"
        return found

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

"""What shapes the candidate transitions of a motion graph."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TransitionsConfig:
    """Frames are those of the words (24 a second by default).

    Attributes:
        window: frames that are compared and later blended, a third of a second.
        radius: a transition has the least distance within so many frames of either clip.
        min_gap: frames between the two ends of a transition within one clip.
        per_word: transitions kept for each motion word, to different clips, the nearest ones.
        context: words of the windows whose signatures are compared: 2.5 seconds, the 12 words of section 6.4.
        proportions: clips are joined when no bone's rest offset differs by more than this share of leg plus torso.

    Raises:
        ValueError: a value out of range.
    """

    window: int = 8
    radius: int = 4
    min_gap: int = 24
    per_word: int = 2
    context: int = 25
    proportions: float = 0.02

    def __post_init__(self) -> None:
        if self.window < 2 or self.radius < 1 or self.per_word < 1 or self.context < 1:
            raise ValueError("window must be at least 2; radius, per_word and context at least 1")
        if self.min_gap < self.window or not self.proportions >= 0:
            raise ValueError("min_gap must be at least window, and proportions not negative")

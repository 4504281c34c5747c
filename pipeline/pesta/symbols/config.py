"""Configuration of symbol strings: which temporal redundancy is taken out."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SymbolsConfig:
    """What is reduced (PESTA, section 5.3); both off keeps speed and cycle counts (section 8.5.2).

    Attributes:
        runs: of a run of one symbol one is kept. Off: how long a posture is held stays in the string.
        repeats: of a tandem repeat one instance is kept. Off: how often a pattern is repeated stays. On with
            runs off, a pattern counts as repeated where its runs are, lengths included (aabaab becomes aab,
            aabaaab stays, and so does aaaa).
    """

    runs: bool = True
    repeats: bool = True

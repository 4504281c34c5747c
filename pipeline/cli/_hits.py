"""Answers of a search for people: a table, and what of each is like the query."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from motionlake.cli._output import tell


def tell_hits(rows: Sequence[Mapping[str, Any]], *, mirrored: bool, as_json: bool) -> None:
    """A table says which answers are `mirrored` only where mirror images were looked for."""
    shown = ({n: v for n, v in row.items() if mirrored or n != "mirrored"} for row in rows)
    tell(rows, [row | _explained(row.pop("shares", ())) for row in shown], as_json=as_json)


def _explained(shares: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """A column a method: what it counts, its distance, and how near that is, from 0 to 1, alone and by the graph."""
    from motionlake.retrieval.hits import TOGETHER

    found = {}
    for share in shares:
        if share["method"] == TOGETHER:
            found[f"{TOGETHER} ({share['weight']:.0%})"] = f"graph {share['along']:.2f}"
            continue
        distance = "beyond its nearest" if share["distance"] is None else f"{share['distance']:.4g}"
        along = "" if share["along"] is None else f", graph {share['along']:.2f}"
        found[f"{share['method']} ({share['weight']:.0%})"] = f"{distance}: near {share['near']:.2f}{along}"
    return found


def what_is_alike(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A line an answer: which joints move most and least like those of the query, and where the frames lie."""
    for row in rows:
        for match in (share["match"] for share in row["shares"] if share["match"] is not None):
            joints, first, last = list(match["joints"]), match["path"][0], match["path"][-1]
            frames = (f"{first[side][0]}-{last[side][1]}" for side in ("query", "clip"))
            yield (
                f"{row['rank']:4}  {joints[0]}, {joints[1]} and {joints[2]} most alike, {joints[-1]} least; "
                f"frames {' as '.join(frames)}"
            )

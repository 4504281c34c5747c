"""What lies together on a map of clips, and what that is called."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array

CLUSTERS: Final = 30
_SHARE: Final = 0.2  # of a cluster that has a label, for it to be named by that


def clusters(points: Float64Array, values: Sequence[str | None], fallback: Sequence[str]) -> list[dict[str, Any]]:
    """Groups of points with a name each: the labels that most of its clips have, or else what they are of."""
    from sklearn.cluster import MiniBatchKMeans

    count = int(min(CLUSTERS, max(1, round(np.sqrt(len(points) / 3)))))
    group = MiniBatchKMeans(count, random_state=0, n_init=3).fit_predict(points)
    found = []
    for number in range(count):
        members = np.flatnonzero(group == number).tolist()
        if len(members):
            middle = np.median(points[members], axis=0)
            text = _named([values[i] for i in members], [fallback[i] for i in members])
            found.append({"x": round(float(middle[0]), 4), "y": round(float(middle[1]), 4), "text": text,
                          "clips": len(members)})  # fmt: skip
    return sorted(found, key=lambda each: -int(each["clips"]))


def _named(values: Sequence[str | None], fallback: Sequence[str]) -> str:
    common = Counter(value for value in values if value).most_common(2)
    names = [name for name, count in common if count >= _SHARE * len(values)]
    return ", ".join(names) or (common[0][0] if common else Counter(fallback).most_common(1)[0][0])

"""Descriptors in a plane by t-SNE (DeepHuMS, figure 3.6)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.pictures.maps import clip_map
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

PERPLEXITY: Final = 20.0
SEED: Final = 0


def tsne(descriptors: NDArray[np.floating]) -> NDArray[np.float64]:
    """[n, 2] places of n descriptors [n, d], the same for the same descriptors.

    Raises:
        ValueError: fewer than four.
    """
    from sklearn.manifold import TSNE

    if len(descriptors) < 4:
        raise ValueError(f"{len(descriptors)} descriptors are too few for a map")
    perplexity = min(PERPLEXITY, (len(descriptors) - 1) / 3)
    with threadpool_limits(limits=1):  # else sums differ from run to run
        found = TSNE(perplexity=perplexity, init="pca", random_state=SEED).fit_transform(
            np.asarray(descriptors, dtype=np.float32)
        )
    return np.asarray(found, dtype=np.float64)


def descriptor_map(descriptors: NDArray[np.floating], classes: Sequence[str], title: str, note: str = "") -> Figure:
    """Each clip a point in the colour and marker of its class; near points have near descriptors.

    Args:
        descriptors: [n, d], n at least 4.
        classes: [n].
        title: one line.
        note: one line below it.
    """
    return clip_map(tsne(descriptors), classes, title, note)

"""Near-duplicate and mirrored clips of a lake."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.deep_motifs.duplicates import MAX_DISTANCE, Duplicate, SignatureSet, find_duplicates
from motionlake.deep_motifs.emd import ground_distances
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.integrity import is_listed, sound
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.retrieval.protocol import EVERYTHING, Scope
from motionlake.stages import words

HELD_PARTS = 64  # of features, a few MB each


def near_duplicates(
    con: Connection, lake: Lake, scope: Scope = EVERYTHING, *, max_distance: float = MAX_DISTANCE, across: bool = False
) -> list[Duplicate]:
    """Pairs of near-duplicates of a lake, nearest first; see `find_duplicates`.

    Args:
        con: to the lake.
        lake: where the features lie.
        scope: which clips; whether mirror images count too.
        max_distance: what may differ, as a part of the movement, in (0, 1).
        across: only pairs of two datasets.

    Raises:
        UserError: no signatures yet, no mirrored ones where they are needed, or a distance out of range.
    """
    if not 0 < max_distance < 1:
        raise UserError(f"a distance of {max_distance}: it is a part of the movement, between 0 and 1")
    if scope.dataset is not None and across:
        raise UserError("one dataset, and across datasets, at once: choose one")
    centroids = [row["centroid"] for row in fetch(con, "corpus_motifs")]
    rows = fetch(con, "signed_clips", scope.as_parameters(con))
    if not centroids:
        raise UserError(f"{lake.root}: has no signatures yet; make them with `motionlake run all`")
    if scope.mirrored and any(row["mirrored"] is None for row in rows):
        raise UserError(
            f"{lake.root}: not every clip has a mirrored signature yet; make them with `motionlake run all`"
        )
    clips = SignatureSet(
        [row["clip"] for row in rows],
        [row["dataset"] for row in rows],
        np.array([row["signature"] for row in rows], dtype=np.float32),
        np.array([row["mirrored"] for row in rows], dtype=np.float32) if scope.mirrored else None,
        ground_distances(np.array(centroids, dtype=np.float32)),
    )
    config = served_config(lake).words
    files = words.features_files(con, config)
    parts = {row["clip"]: row["part"] for row in rows}
    held = lru_cache(HELD_PARTS)(lambda file: dict(words.read_features(sound(lake, file))))

    def features(clip: str) -> Float32Array:
        file = files[parts[clip]]
        if not is_listed(lake, file):
            raise UserError(f"{clip}: has no words under this configuration; make them with `motionlake run all`")
        return held(file)[clip]

    return find_duplicates(clips, features, config, max_distance=max_distance, across=across)

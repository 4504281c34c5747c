"""Clusters of a lake's clips, without labels (Deep Motifs, section 4.3)."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from motionlake.deep_motifs.classification import cluster_clips
from motionlake.deep_motifs.emd import emd_matrix
from motionlake.lake.catalog import Connection
from motionlake.retrieval.labelling.labelled_clips import lake_ground, signed_clips
from motionlake.retrieval.protocol import EVERYTHING, Scope


@dataclass(frozen=True)
class ClusteredClip:
    """The cluster of a clip, from 0, the largest first."""

    clip: str
    cluster: int
    label: str | None
    dataset: str

    def as_row(self) -> dict[str, object]:
        return asdict(self)


def clusters_of_lake(con: Connection, k: int | None, scope: Scope = EVERYTHING) -> tuple[list[ClusteredClip], float]:
    """The cluster of every clip with a signature, by cluster and name, and the mean silhouette; see `cluster_clips`.

    Raises:
        UserError: too few clips for so many clusters, or no signatures.
    """
    signed = signed_clips(con, scope)
    found = cluster_clips(emd_matrix(signed.signatures, lake_ground(con)), k)
    rows = [
        ClusteredClip(clip.clip, int(cluster), clip.label, clip.dataset)
        for clip, cluster in zip(signed.clips, found.clusters, strict=True)
    ]
    return sorted(rows, key=lambda r: (r.cluster, r.clip)), found.silhouette

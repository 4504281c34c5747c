"""Earth Mover's Distance between signatures (Deep Motifs, section 4.3, equations 4 to 6).

The mass at a motif is its tf-idf weight; signatures are scaled to mass 1, so all mass is moved and the
total flow of equation 6 is 1. The ground distance d_ij is the L2 distance of the motifs' centroids in the
embedding space. POT's network simplex solves the transport exactly. `emd_deep_motifs` is the paper's variant.
"""

from __future__ import annotations

from motionlake.deep_motifs.emd.exact import (
    check_model,
    check_signature,
    emd,
    emd_deep_motifs,
    emd_many,
    emd_matrix,
    emd_partial,
    ground_distances,
)
from motionlake.deep_motifs.emd.nearest import Nearest, SignatureIndex, nearest_many, nearest_signatures

__all__ = [
    "Nearest",
    "SignatureIndex",
    "check_model",
    "check_signature",
    "emd",
    "emd_deep_motifs",
    "emd_many",
    "emd_matrix",
    "emd_partial",
    "ground_distances",
    "nearest_many",
    "nearest_signatures",
]

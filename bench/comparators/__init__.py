"""Methods that Deep Motifs compares itself with, written from their descriptions, on the clips and features of ours.

A module each: `relational` and `templates` (Müller and Röder 2006), `volumes` (Sun et al. 2011), `keys` (Kapadia et
al. 2013), `manifold` (Holden et al. 2015), `aligned_clusters` (ACA and HACA; Zhou, De la Torre and Hodgins 2008,
2013). The papers themselves were not at hand: what is told of them is from Deep Motifs, abstracts and what we knew,
unchecked. What that leaves open is decided in the docstring of each module. `python -m bench.comparators` measures
them.
"""

"""PESTA's measures on a labelled lake: a module for each of its experiments (section 8)."""

"""Measures on a labelled lake: what `motionlake evaluate` calls."""

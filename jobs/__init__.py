"""Dask jobs: one thin job a stage over the pure functions of `motionlake.stages`."""

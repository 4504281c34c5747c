"""Dask jobs: one thin job a stage over the pure functions of `pipeline.stages`."""

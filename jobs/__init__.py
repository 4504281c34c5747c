"""Running stages: a session on one lake, shards on a Dask cluster, models trained when a stage needs them."""

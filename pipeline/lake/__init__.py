"""The lake: its folder, configuration, catalog, Parquet parts, models, and what reads them."""

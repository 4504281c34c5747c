CREATE OR REPLACE VIEW frames AS
SELECT f.* EXCLUDE (part)
FROM read_parquet(live_files('frames', 'frames/*/*.parquet'), hive_partitioning = true, hive_types = {'dataset': VARCHAR}) f
SEMI JOIN clips c ON c.clip = f.clip AND c.part = f.part;

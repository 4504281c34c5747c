-- Where every clip lies on the map that the stage "map" made, as far as it is still in the lake.
CREATE OR REPLACE VIEW clip_map AS
SELECT p.clip, p.x, p.y
FROM read_parquet(live_files('map', 'map/*.parquet')) p
SEMI JOIN manifest m ON m.stage = 'map' AND m.state = 'ok' AND m.key = p.key
SEMI JOIN clips c ON c.clip = p.clip;

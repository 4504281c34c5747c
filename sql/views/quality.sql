-- What the stage "quality" found; a part may outlive its use for a moment: only parts the manifest names, of clips that
-- the lake holds, count.
CREATE OR REPLACE VIEW quality AS
SELECT q.* EXCLUDE (part, key, ranges)
FROM read_parquet(live_files('quality', 'quality/*.parquet')) q
SEMI JOIN manifest m ON m.stage = 'quality' AND m.state = 'ok' AND m.key = q.key
SEMI JOIN clips c ON c.clip = q.clip AND c.part = q.part;

CREATE OR REPLACE VIEW quality_ranges AS
SELECT clip, unnest(ranges, recursive := true)
FROM read_parquet(live_files('quality', 'quality/*.parquet')) q
SEMI JOIN manifest m ON m.stage = 'quality' AND m.state = 'ok' AND m.key = q.key
SEMI JOIN clips c ON c.clip = q.clip AND c.part = q.part;

-- What is given may be a column called clip, so that no column in here may be.
CREATE OR REPLACE MACRO quality_verdict(name) AS (
    SELECT found FROM (SELECT clip AS judged, verdict AS found FROM quality) WHERE judged = name
);

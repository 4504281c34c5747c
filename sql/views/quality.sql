-- What the stage "quality" found; a part may outlive its use for a moment: only parts the manifest names, of clips that
-- the lake holds, count. Parts that an earlier version of the stage wrote lack columns.
CREATE OR REPLACE MACRO checked_clips() AS TABLE
WITH kept AS (
    SELECT NULL::STRUCT(
        fault VARCHAR, joint VARCHAR, start BIGINT, stop BIGINT, rung BIGINT, level DOUBLE, severity DOUBLE
    )[] AS levels, NULL::DOUBLE AS bad_share
    WHERE false
    UNION ALL BY NAME
    FROM read_parquet(live_files('quality', 'quality/*.parquet'), union_by_name := true)
)
SELECT q.*
FROM kept q
SEMI JOIN manifest m ON m.stage = 'quality' AND m.state = 'ok' AND m.key = q.key
SEMI JOIN clips c ON c.clip = q.clip AND c.part = q.part;

CREATE OR REPLACE VIEW quality_ranges AS SELECT clip, unnest(ranges, recursive := true) FROM checked_clips();

CREATE OR REPLACE VIEW quality_usual AS
SELECT dataset, fault, joint, clips, faulty, median, highest FROM usual_faults();

CREATE OR REPLACE VIEW quality_unusual AS
SELECT clip, fault, joint, start, stop, severity FROM unusual_faults();

-- `verdict_in_dataset` is as `check` in motionlake.motion.quality.verdict has it, of the faults that stand out.
CREATE OR REPLACE VIEW quality AS
WITH told AS (
    SELECT clip, fault, start, stop,
        max(stop) OVER (PARTITION BY clip ORDER BY start, stop ROWS BETWEEN UNBOUNDED PRECEDING AND 1 PRECEDING) AS past
    FROM quality_unusual WHERE fault <> 'missing'  -- whose frames are not known
),
touched AS (
    SELECT clip, sum(greatest(0, stop - greatest(start, coalesce(past, 0))))::BIGINT AS frames,
        bool_or(fault IN ('fps', 'unit', 'up', 'swapped_sides')) AS whole
    FROM told GROUP BY clip
)
SELECT q.* EXCLUDE (part, key, ranges, levels, bad_share), CASE
    WHEN u.clip IS NULL THEN 'ok'
    WHEN t.whole OR greatest(coalesce(t.frames, 0) / c.frames, q.missing) > q.bad_share THEN 'bad'
    ELSE 'doubtful'
END AS verdict_in_dataset
FROM checked_clips() q
JOIN clips c ON c.clip = q.clip
LEFT JOIN (SELECT DISTINCT clip FROM quality_unusual) u ON u.clip = q.clip
LEFT JOIN touched t ON t.clip = q.clip;

-- What is given may be a column called clip, so that no column in here may be.
CREATE OR REPLACE MACRO quality_verdict(name) AS (
    SELECT found FROM (SELECT clip AS judged, verdict AS found FROM checked_clips()) WHERE judged = name
);

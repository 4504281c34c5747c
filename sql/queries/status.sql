-- name: status_datasets
-- One row a dataset; datasets all of whose files were rejected are listed too.
WITH held AS (
    SELECT dataset, count(*)::BIGINT AS clips, sum(frames)::BIGINT AS frames, sum(seconds) / 60 AS minutes,
        count(DISTINCT rig)::BIGINT AS rigs, count(label)::BIGINT AS labelled
    FROM clips GROUP BY dataset
), refused AS (
    SELECT dataset, count(*)::BIGINT AS rejects FROM rejects GROUP BY dataset
)
SELECT dataset, coalesce(clips, 0) AS clips, coalesce(frames, 0) AS frames, coalesce(minutes, 0) AS minutes,
    coalesce(rigs, 0) AS rigs, coalesce(labelled, 0) AS labelled, coalesce(rejects, 0) AS rejects
FROM held FULL JOIN refused USING (dataset) ORDER BY dataset;

-- name: status_stages
SELECT stage, count(*) FILTER (state = 'ok')::BIGINT AS shards, sum(rows)::BIGINT AS rows,
    sum(bytes)::BIGINT AS bytes, count(*) FILTER (state = 'failed')::BIGINT AS failed
FROM manifest GROUP BY stage;

-- name: status_rows
-- Rows of what stages fill in the catalog alone, or of which a part may hold more than is in the lake still.
SELECT 'frames' AS stage, coalesce(sum(frames), 0)::BIGINT AS rows FROM clips WHERE format <> 'synthetic'
UNION ALL SELECT 'synthesize', coalesce(sum(frames), 0)::BIGINT FROM clips WHERE format = 'synthetic'
UNION ALL SELECT 'signatures', count(*)::BIGINT FROM signatures
UNION ALL SELECT 'transitions', count(*)::BIGINT FROM transitions;

-- name: status_models
SELECT model, date_trunc('second', created) AS created, round(seconds, 1) AS seconds, metrics FROM models WHERE "current" ORDER BY kind;

-- name: lake_summary
-- One row a dataset: what a reader wants to know of a lake first.
SELECT c.dataset, count(*)::BIGINT AS clips, sum(c.seconds) / 60 AS minutes, count(DISTINCT c.rig)::BIGINT AS rigs,
    count(c.label)::BIGINT AS labelled, count(DISTINCT c.label)::BIGINT AS classes,
    coalesce(sum(s.words), 0)::BIGINT AS words,
    (SELECT count(*) FROM segments g JOIN clips d USING (clip) WHERE d.dataset = c.dataset)::BIGINT AS segments
FROM clips c LEFT JOIN signatures s USING (clip)
WHERE $dataset::VARCHAR IS NULL OR c.dataset = $dataset
GROUP BY c.dataset ORDER BY c.dataset;

-- name: table_names
SELECT table_name AS name FROM duckdb_tables() WHERE database_name = current_database() AND NOT temporary ORDER BY name;

-- name: status_metrics
SELECT * EXCLUDE (finished) FROM stage_metrics();

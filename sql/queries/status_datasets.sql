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

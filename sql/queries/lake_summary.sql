-- One row a dataset: what a reader wants to know of a lake first.
SELECT c.dataset, count(*)::BIGINT AS clips, sum(c.seconds) / 60 AS minutes, count(DISTINCT c.rig)::BIGINT AS rigs,
    count(c.label)::BIGINT AS labelled, count(DISTINCT c.label)::BIGINT AS classes,
    coalesce(sum(s.words), 0)::BIGINT AS words,
    (SELECT count(*) FROM segments g JOIN clips d USING (clip) WHERE d.dataset = c.dataset)::BIGINT AS segments
FROM clips c LEFT JOIN signatures s USING (clip)
WHERE $dataset::VARCHAR IS NULL OR c.dataset = $dataset
GROUP BY c.dataset ORDER BY c.dataset;

-- Parts of recorded and of synthetic clips.
SELECT c.part, c.dataset, any_value(m.key) AS key, count(*)::BIGINT AS clips, sum(c.frames)::BIGINT AS frames,
    bool_and(c.format = 'synthetic') AS synthetic
FROM clips c JOIN manifest m ON m.stage IN ('frames', 'synthesize') AND m.part = c.part
GROUP BY ALL ORDER BY c.dataset, c.part;

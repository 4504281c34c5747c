SELECT c.part, c.dataset, any_value(m.key) AS key, count(*)::BIGINT AS clips, sum(c.frames)::BIGINT AS frames
FROM clips c JOIN manifest m ON m.stage = 'frames' AND m.part = c.part
GROUP BY ALL ORDER BY c.dataset, c.part;

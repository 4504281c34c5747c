SELECT stage, count(*) FILTER (state = 'ok')::BIGINT AS shards, sum(rows)::BIGINT AS rows,
    sum(bytes)::BIGINT AS bytes, count(*) FILTER (state = 'failed')::BIGINT AS failed
FROM manifest GROUP BY stage;

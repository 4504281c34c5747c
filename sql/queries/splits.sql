SELECT dataset, split, count(*)::BIGINT AS clips FROM clips GROUP BY ALL ORDER BY ALL;

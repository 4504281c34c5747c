SELECT dataset, split, count(*)::BIGINT AS clips FROM clips WHERE format <> 'synthetic' GROUP BY ALL ORDER BY ALL;

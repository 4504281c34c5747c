SELECT count(*)::BIGINT AS rejects FROM rejects r JOIN sources s USING (dataset, path)
WHERE dataset = $dataset AND s.root = $root;

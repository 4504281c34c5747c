SELECT count(*)::BIGINT AS unmatched FROM (SELECT unnest($paths::VARCHAR[]) AS path) p
WHERE p.path NOT IN (SELECT path FROM sources WHERE dataset = $dataset AND root = $root);

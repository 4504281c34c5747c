UPDATE models SET "current" = false WHERE kind = $kind;
INSERT INTO models
SELECT $kind || '-' || v, $kind, v, $key, $data_hash, $config, $figures,
    $file, true, $seconds, now()::TIMESTAMP
FROM (SELECT coalesce(max(version), 0) + 1 AS v FROM models WHERE kind = $kind);

INSERT OR REPLACE INTO manifest BY NAME
SELECT stage, key, part, dataset, 'planned' AS state, NULL AS reason,
    coalesce((SELECT m.attempts FROM manifest m WHERE m.stage = r.stage AND m.key = r.key), 0) AS attempts,
    0 AS rows, 0 AS bytes, spec, [] AS files
FROM rows r;

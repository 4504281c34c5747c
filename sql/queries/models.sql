-- name: add_model
UPDATE models SET "current" = false WHERE kind = $kind;
INSERT INTO models
SELECT $kind || '-' || v, $kind, v, $key, $data_hash, $config, $metrics,
    $file, true, $seconds, now()::TIMESTAMP
FROM (SELECT coalesce(max(version), 0) + 1 AS v FROM models WHERE kind = $kind);

-- name: current_model
SELECT model, kind, version, key, config, metrics, file FROM models WHERE kind = $kind AND "current";

-- name: keyed_model
SELECT model, kind, version, key, config, metrics, file FROM models WHERE kind = $kind AND key = $key
ORDER BY version DESC LIMIT 1;

-- name: model_file
SELECT file FROM models WHERE model = $model;

-- name: next_version
SELECT coalesce(max(version), 0) + 1 AS version FROM models WHERE kind = $kind;

-- name: models_behind
-- By the way to compare clips: the model that has made what it compares, where another is current now. A word network
-- that is newer than the motifs has embedded nothing that is compared.
WITH served AS (
    (SELECT 'signature' AS method, 'motifs' AS kind, model FROM motifs LIMIT 1) UNION ALL
    (SELECT 'alignment', 'postures', model FROM postures LIMIT 1) UNION ALL
    (SELECT 'descriptor', 'descriptors', model FROM descriptors LIMIT 1) UNION ALL
    (SELECT 'submotion', 'submotion', model FROM submotion_parts LIMIT 1)
), current AS (SELECT kind, model, created FROM models WHERE "current")
SELECT method, current.model, served.model AS served FROM current JOIN served USING (kind)
WHERE current.model <> served.model
UNION ALL
SELECT method, network.model, served.model
FROM served JOIN current AS motifs USING (kind) JOIN current AS network ON network.kind = 'network'
WHERE motifs.kind = 'motifs' AND network.created > motifs.created
ORDER BY method;

-- name: served_motifs
SELECT DISTINCT model FROM motifs;

-- name: served_postures
SELECT model FROM postures LIMIT 1;

-- name: models_compared
-- What the signatures and strings of the lake are made over, by the method that compares them.
SELECT DISTINCT 'signature' AS method, model FROM motifs UNION ALL SELECT DISTINCT 'alignment', model FROM postures;

-- name: served_descriptors
SELECT model, kind, key, file, metrics FROM models WHERE model = (SELECT model FROM descriptors LIMIT 1);

-- name: served_submotions
SELECT model, kind, key, file, metrics FROM models WHERE model = (SELECT model FROM submotion_parts LIMIT 1);

-- name: training_clips
-- Recorded clips to train on: of one dataset, of one split; all where these are NULL.
SELECT clip, part, dataset, fps, frames, label, content_hash
FROM clips
WHERE format <> 'synthetic' AND ($dataset::VARCHAR IS NULL OR dataset = $dataset)
    AND ($split::VARCHAR IS NULL OR split = $split)
ORDER BY clip;

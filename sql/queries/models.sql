-- name: add_model
UPDATE models SET "current" = false WHERE kind = $kind;
INSERT INTO models
SELECT $kind || '-' || v, $kind, v, $key, $data_hash, $config, $metrics,
    $file, true, $seconds, now()::TIMESTAMP
FROM (SELECT coalesce(max(version), 0) + 1 AS v FROM models WHERE kind = $kind);

-- name: current_model
SELECT model, kind, version, key, config, metrics, file FROM models WHERE kind = $kind AND "current";

-- name: model_file
SELECT file FROM models WHERE model = $model;

-- name: next_version
SELECT coalesce(max(version), 0) + 1 AS version FROM models WHERE kind = $kind;

-- name: models_behind
-- The models whose numbers are served, where the current one of the kind is another. A word network that is newer than
-- the motifs has embedded nothing that is served.
WITH served AS (
    (SELECT 'motifs' AS kind, model FROM motifs LIMIT 1) UNION ALL
    (SELECT 'postures', model FROM postures LIMIT 1) UNION ALL
    (SELECT 'descriptors', model FROM descriptors LIMIT 1) UNION ALL
    (SELECT 'submotion', model FROM submotions LIMIT 1)
), current AS (SELECT kind, model, created FROM models WHERE "current")
SELECT kind, current.model, served.model AS served FROM current JOIN served USING (kind)
WHERE current.model <> served.model
UNION ALL
SELECT network.kind, network.model, motifs.model
FROM current AS network JOIN current AS motifs ON network.kind = 'network' AND motifs.kind = 'motifs'
WHERE network.created > motifs.created AND EXISTS (FROM served WHERE kind = 'motifs')
ORDER BY kind;

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
SELECT model, kind, key, file, metrics FROM models WHERE model = (SELECT model FROM submotions LIMIT 1);

-- name: training_clips
-- Recorded clips to train on: of one dataset, of one split; all where these are NULL.
SELECT clip, part, dataset, fps, frames, label, content_hash
FROM clips
WHERE format <> 'synthetic' AND ($dataset::VARCHAR IS NULL OR dataset = $dataset)
    AND ($split::VARCHAR IS NULL OR split = $split)
ORDER BY clip;

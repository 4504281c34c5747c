-- name: makers_of_files
-- What made each of some files: shards of stages, and models.
SELECT f.file, m.stage, m.key, m.part, m.dataset, m.spec, NULL AS model, NULL AS kind
FROM (SELECT unnest($files::VARCHAR[]) AS file) f JOIN manifest m ON m.state = 'ok' AND list_contains(m.files, f.file)
UNION ALL BY NAME
SELECT f.file, NULL AS stage, d.key, NULL AS part, NULL AS dataset, d.config AS spec, d.model, d.kind
FROM (SELECT unnest($files::VARCHAR[]) AS file) f JOIN models d ON d.file = f.file
ORDER BY file;

-- name: sources_of_part
SELECT dataset, path, root, size, mtime_ns, content_hash, config_hash FROM sources WHERE part = $part ORDER BY path;

-- name: clip_rows_of_part
SELECT * FROM clips WHERE part = $part ORDER BY clip;

-- name: model_row
SELECT model, kind, key, config, metrics, file, "current" FROM models WHERE file = $file;

-- name: model_in_use
-- Whether anything that is served was made with a version of a model.
SELECT EXISTS (
    FROM (
        SELECT model FROM motifs UNION SELECT model FROM postures UNION SELECT model FROM descriptors
        UNION SELECT model FROM submotion_parts UNION SELECT model FROM synthetic
    ) WHERE model = $model
) OR EXISTS (FROM manifest WHERE state = 'ok' AND contains(spec, $file)) AS used;

-- name: forget_model
DELETE FROM models WHERE model = $model AND NOT "current";

-- name: forget_shard
DELETE FROM manifest WHERE stage = $stage AND key = $key;

-- name: trained_models
SELECT file FROM models WHERE "current" AND NOT coalesce((metrics ->> 'pretrained') = 'true', false) ORDER BY file;

-- name: source_parts
SELECT part, root, path FROM sources;

-- name: synthetic_parts
SELECT DISTINCT part FROM clips WHERE format = 'synthetic';

-- name: parts_of_sources
-- Frames parts of recorded clips that are left to merge: where their files come from, and whether nothing is left undone
-- of them. Words that are compared with one another, and transitions, name the parts of both sides.
SELECT c.part, c.dataset, c.clips, c.frames, s.root, s.config_hash, s.first,
    EXISTS (
        FROM manifest m WHERE m.state = 'ok' AND m.stage IN ('neighbours', 'transitions')
            AND (m.part = c.part OR starts_with(m.part, c.part || '+') OR ends_with(m.part, '+' || c.part))
    ) AS named,
    EXISTS (FROM manifest m WHERE m.state <> 'ok' AND m.part = c.part) AS unfinished
FROM (
    SELECT part, dataset, count(*)::BIGINT AS clips, sum(frames)::BIGINT AS frames
    FROM clips WHERE format <> 'synthetic' GROUP BY ALL
    HAVING count(*) <= $clips AND sum(frames) <= $frames
) c
JOIN (
    SELECT part, any_value(root) AS root, any_value(config_hash) AS config_hash, min(path) AS first
    FROM sources GROUP BY part HAVING count(DISTINCT (root, config_hash)) = 1
) s ON s.part = c.part
ORDER BY c.dataset, s.root, s.first, c.part;

-- name: shards_of_parts
SELECT m.stage, m.key, m.part, m.files FROM manifest m JOIN (SELECT unnest($parts::VARCHAR[]) AS part) p ON p.part = m.part
WHERE m.state = 'ok' ORDER BY ALL;

-- name: clips_of_parts
SELECT part, clip, path, layout FROM clips WHERE part IN (SELECT unnest($parts::VARCHAR[])) ORDER BY part, clip;

-- name: files_of_parts
SELECT part, path, content_hash FROM sources WHERE part IN (SELECT unnest($parts::VARCHAR[])) ORDER BY path;

-- name: count_parts
-- Parts that serve, and their bytes.
SELECT count(*)::BIGINT AS files, coalesce(sum(size), 0)::BIGINT AS bytes FROM files
WHERE (file LIKE '%.parquet' OR file LIKE '%.arrow') AND NOT starts_with(file, 'shortlist/');

-- name: merge_shards
-- A row a stage and part for all that were merged, given as rows of (stage, part) with what came of them.
INSERT OR REPLACE INTO manifest BY NAME
SELECT r.stage, r.key, r.merged AS part, any_value(m.dataset) AS dataset, 'ok' AS state, NULL AS reason,
    max(m.attempts) AS attempts, sum(m.rows)::BIGINT AS rows, coalesce(any_value(r.bytes), sum(m.bytes))::BIGINT AS bytes,
    '{}' AS spec, any_value(r.files) AS files, sum(m.seconds) AS seconds, max(m.finished) AS finished
FROM rows r JOIN manifest m ON m.stage = r.stage AND m.part = r.part AND m.state = 'ok'
GROUP BY r.stage, r.key, r.merged;
DELETE FROM manifest USING rows r WHERE manifest.part = r.part AND manifest.stage = r.stage;

-- name: merge_parts_of_clips
UPDATE clips SET part = r.merged FROM (SELECT DISTINCT part, merged FROM rows) r WHERE clips.part = r.part;

-- name: merge_parts_of_sources
UPDATE sources SET part = r.merged FROM (SELECT DISTINCT part, merged FROM rows) r WHERE sources.part = r.part;

-- name: merge_parts_of_words
UPDATE words SET part = r.merged FROM (SELECT DISTINCT part, merged FROM rows) r WHERE words.part = r.part;

-- name: merge_parts_of_word_motifs
UPDATE word_motifs SET part = r.merged FROM (SELECT DISTINCT part, merged FROM rows) r WHERE word_motifs.part = r.part;

-- name: merge_parts_of_symbol_strings
UPDATE symbol_strings SET part = r.merged FROM (SELECT DISTINCT part, merged FROM rows) r WHERE symbol_strings.part = r.part;

-- name: merge_parts_of_descriptors
UPDATE descriptors SET part = r.merged FROM (SELECT DISTINCT part, merged FROM rows) r WHERE descriptors.part = r.part;

-- name: merge_parts_of_submotion_parts
INSERT INTO submotion_parts
SELECT DISTINCT r.merged AS part, s.model FROM submotion_parts s JOIN rows r ON r.part = s.part;
DELETE FROM submotion_parts USING rows r WHERE submotion_parts.part = r.part;

-- name: replace_shards
-- The same results of a stage that reads the whole lake, in other files.
INSERT OR REPLACE INTO manifest BY NAME
SELECT stage, key, part, dataset, 'ok' AS state, NULL AS reason, 1 AS attempts, rows, bytes, '{}' AS spec, files,
    (SELECT sum(m.seconds) FROM manifest m WHERE m.stage = $stage AND m.state = 'ok') / count(*) OVER () AS seconds,
    now()::TIMESTAMP AS finished
FROM rows;
DELETE FROM manifest WHERE stage = $stage AND state = 'ok' AND key NOT IN (SELECT key FROM rows);

-- name: free_blocks
-- Of the catalog's file: how many blocks DuckDB has, how many of them hold nothing, and the bytes of one.
SELECT total_blocks::BIGINT AS blocks, free_blocks::BIGINT AS free, block_size::BIGINT AS bytes
FROM pragma_database_size() WHERE database_name = current_database();

-- name: superseded_models
-- Versions that serve no more, newest first.
SELECT model, kind, file FROM models WHERE NOT "current" ORDER BY kind, version DESC;

-- name: models_named
-- What models that are kept say of others.
SELECT metrics, config FROM models WHERE model NOT IN (SELECT unnest($without::VARCHAR[]));

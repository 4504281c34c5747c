-- name: all_sources
SELECT dataset, path, root FROM sources ORDER BY dataset, path;

-- name: count_sources
SELECT count(*)::BIGINT AS sources FROM sources;

-- name: sources_of
SELECT path, root, size, mtime_ns, content_hash, config_hash FROM sources WHERE dataset = $dataset;

-- name: files_that_differ
-- Of the files found in a folder (`rows`), what the lake knows of those that it does not know as they are, or that are
-- looked into whatever it knows: all of them, or those that were rejected.
SELECT r.path, s.root, s.size, s.mtime_ns, s.content_hash, s.config_hash
FROM rows r LEFT JOIN sources s ON s.dataset = $dataset AND s.path = r.path
WHERE $checksum OR s.path IS NULL OR s.root <> $root OR s.config_hash <> $shaping_hash
    OR s.size <> r.size OR s.mtime_ns <> r.mtime_ns OR r.path IN (SELECT unnest($retried::VARCHAR[]));

-- name: files_not_found
-- Of the files that were taken in from a folder, those that were not found there (`rows`).
SELECT path FROM sources s ANTI JOIN rows r USING (path) WHERE s.dataset = $dataset AND s.root = $root ORDER BY path;

-- name: load_sources
INSERT INTO sources BY NAME FROM rows ORDER BY dataset, path;

-- name: touch_sources
UPDATE sources SET size = r.size, mtime_ns = r.mtime_ns
FROM rows r WHERE sources.dataset = r.dataset AND sources.path = r.path;

-- name: forget_sources
-- Before rows of these source files are entered again.
DELETE FROM clips USING rows r WHERE clips.dataset = r.dataset AND clips.path = r.path;
DELETE FROM rejects USING rows r WHERE rejects.dataset = r.dataset AND rejects.path = r.path;
DELETE FROM sources USING rows r WHERE sources.dataset = r.dataset AND sources.path = r.path;

-- name: roots
SELECT dataset, root, options, labels_hash FROM roots ORDER BY dataset, root;

-- name: save_root
INSERT OR REPLACE INTO roots VALUES ($dataset, $root, $options, $labels_hash);

-- name: save_root_options
UPDATE roots SET options = $options WHERE dataset = $dataset AND root = $root;

-- name: forget_roots
DELETE FROM roots WHERE dataset = $dataset;
DELETE FROM manifest WHERE stage = 'frames' AND dataset = $dataset AND state <> 'ok';

-- name: load_rejects
INSERT INTO rejects BY NAME FROM rows ORDER BY dataset, path;

-- name: rejects_of
SELECT path, line, reason FROM rejects WHERE dataset = $dataset ORDER BY path;

-- name: count_rejects
SELECT count(*)::BIGINT AS rejects FROM rejects r JOIN sources s USING (dataset, path)
WHERE dataset = $dataset AND s.root = $root;

-- name: sources_told
-- What SOURCE.json of each folder said when it was taken in.
SELECT dataset, options->'$.source' AS source FROM roots
WHERE coalesce(json_type(options, '$.source'), 'NULL') = 'OBJECT' ORDER BY dataset, root;

-- name: datasets_of_clips
-- What the catalog itself knows of the licences of each dataset.
SELECT dataset, count(*)::BIGINT AS clips,
    coalesce(list_sort(list(DISTINCT licence) FILTER (licence IS NOT NULL)), []) AS licences,
    count(*) FILTER (licence IS NULL)::BIGINT AS unlicensed
FROM clips GROUP BY dataset ORDER BY dataset;

-- name: origins_of_synthetic
-- Datasets of the training clips and of the seed clips of synthetic ones.
SELECT DISTINCT dataset, origin FROM (
    SELECT c.dataset, unnest(list_append(s.datasets, o.dataset)) AS origin
    FROM synthetic s JOIN clips c USING (clip) LEFT JOIN clips o ON o.clip = s.seed_clip
) WHERE origin IS NOT NULL ORDER BY ALL;

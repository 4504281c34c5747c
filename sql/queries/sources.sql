-- name: all_sources
SELECT dataset, path, root FROM sources ORDER BY dataset, path;

-- name: count_sources
SELECT count(*)::BIGINT AS sources FROM sources;

-- name: sources_of
SELECT path, root, size, mtime_ns, content_hash, config_hash FROM sources WHERE dataset = $dataset;

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

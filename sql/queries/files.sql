-- name: files
SELECT file, size, mtime_ns, crc32, sha256 FROM files ORDER BY file;

-- name: add_files
INSERT OR REPLACE INTO files BY NAME FROM rows;

-- name: forget_unnamed_files
DELETE FROM files WHERE file NOT IN (SELECT unnest(files) FROM manifest WHERE state = 'ok' UNION SELECT file FROM models);

-- name: unlisted_files
-- Files that the manifest or models name, of which neither size nor hash is known.
SELECT file FROM (SELECT unnest(files) AS file FROM manifest WHERE state = 'ok' UNION SELECT file FROM models)
WHERE file NOT IN (SELECT file FROM files) ORDER BY file;

-- name: settings
SELECT file, text FROM settings ORDER BY file;

-- name: save_settings
DELETE FROM settings;
INSERT INTO settings BY NAME FROM rows;

-- name: use_lake
SET file_search_path = $root;

-- name: attach
ATTACH $catalog AS lake (READ_ONLY);

-- name: attach_for_writing
ATTACH $catalog AS lake;

-- name: use_catalog
USE lake;

-- name: detach
DETACH lake;

-- name: schema_version
SELECT coalesce(max(version), 0) AS version FROM schema_version;

-- name: set_schema_version
INSERT INTO schema_version VALUES ($version);

-- name: has_function
-- Connections of a process to one catalog share the functions that the first of them made.
SELECT 1 FROM duckdb_functions() WHERE function_name = $name LIMIT 1;

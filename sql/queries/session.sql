-- name: one_thread
-- While writing: choices among equals do not depend on the machine, and memory stays small.
SET threads = 1;

-- name: use_lake
SET file_search_path = $root;

-- name: open_catalog
-- In a database instance of its own: others in this process may have an earlier catalog open.
ATTACH $catalog AS lake (READ_ONLY);
USE lake;

-- name: schema_version
SELECT coalesce(max(version), 0) AS version FROM schema_version;

-- name: set_schema_version
INSERT INTO schema_version VALUES ($version);

-- name: has_function
-- Connections of a process to one catalog share the functions that the first of them made.
SELECT 1 FROM duckdb_functions() WHERE function_name = $name LIMIT 1;

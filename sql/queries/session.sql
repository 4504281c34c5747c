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

-- name: listed_files_alone
-- Views read what the catalog lists, and refuse what is not as it was written.
CREATE OR REPLACE TEMP MACRO live_files(folder, pattern) AS sound_files(folder);

-- name: limit_memory
SET memory_limit = $memory;

-- name: lock_down
-- Of files, the lake's Parquet folders alone; no network, no extensions; and no way back.
SET temp_directory = $temporary;
SET autoinstall_known_extensions = false;
SET autoload_known_extensions = false;
SET allow_community_extensions = false;
SET allow_persistent_secrets = false;
SET python_enable_replacements = false;
SET allowed_directories = $folders;
SET enable_external_access = false;
SET lock_configuration = true;

-- name: schema_version
SELECT coalesce(max(version), 0) AS version FROM schema_version;

-- name: set_schema_version
INSERT INTO schema_version VALUES ($version);

-- name: functions_among
SELECT DISTINCT function_name AS name FROM duckdb_functions()
WHERE function_name IN (SELECT unnest($names::VARCHAR[]));

-- name: has_function
-- Connections of a process to one catalog share the functions that the first of them made.
SELECT 1 FROM duckdb_functions() WHERE function_name = $name LIMIT 1;

-- name: attach_before
ATTACH $catalog AS before (READ_ONLY);

-- name: detach_before
DETACH before;

-- name: one_thread
-- While writing: choices among equals do not depend on the machine, and memory stays small.
SET threads = 1;

-- name: use_lake
SET file_search_path = $root;

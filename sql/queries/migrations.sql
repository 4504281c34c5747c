-- name: clips_of_part
-- In every version since 0, as the statements below.
SELECT clip, fps, frames, rest_offsets, rig, joints FROM clips JOIN layouts USING (layout)
WHERE part = $part ORDER BY clip;

-- name: files_of_frames
SELECT stage, key, files FROM manifest WHERE stage IN ('frames', 'synthesize') AND state = 'ok';

-- name: columns
SELECT table_name, column_name, data_type, is_nullable
FROM duckdb_columns() c SEMI JOIN duckdb_tables() t USING (database_name, table_name)
WHERE database_name = current_database();

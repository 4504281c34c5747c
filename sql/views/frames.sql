CREATE OR REPLACE VIEW frames AS
SELECT f.* EXCLUDE (part)
FROM read_parquet(live_files('frames', 'frames/*/*.parquet'), hive_partitioning = true, hive_types = {'dataset': VARCHAR}) f
SEMI JOIN clips c ON c.clip = f.clip AND c.part = f.part;

-- What each joint of every clip's file is to its rig, as the footers of frames parts say; parts of before there was such
-- a key say nothing.
CREATE OR REPLACE VIEW rig_joints AS
WITH maps AS (
    SELECT parse_filename(file_name, true) AS part, unnest(from_json(decode(value), '[{
        "rig": "VARCHAR", "clips": ["VARCHAR"],
        "joints": [{
            "joint": "VARCHAR", "canonical": "VARCHAR", "how": "VARCHAR", "confidence": "DOUBLE",
            "evidence": "MAP(VARCHAR, DOUBLE)"
        }]
    }]'), max_depth := 2)
    FROM parquet_kv_metadata(live_files('frames', 'frames/*/*.parquet'))
    WHERE decode(key) = 'rigs'
), clips_of_maps AS (
    SELECT part, rig, joints, unnest(clips) AS clip FROM maps
)
SELECT m.clip, m.rig, unnest(m.joints, max_depth := 2)
FROM clips_of_maps m
SEMI JOIN clips c ON c.clip = m.clip AND c.part = m.part;

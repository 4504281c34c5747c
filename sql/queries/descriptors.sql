-- name: load_descriptors
DELETE FROM descriptors WHERE model <> $model OR part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO descriptors BY NAME
SELECT s.clip, s.descriptor::FLOAT[512] AS descriptor, $model AS model, s.part
FROM read_parquet($files) s SEMI JOIN clips c ON c.clip = s.clip AND c.part = s.part
ORDER BY clip;

-- name: load_submotion_parts
DELETE FROM submotion_parts WHERE model <> $model OR part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO submotion_parts SELECT part, $model FROM (SELECT unnest($parts::VARCHAR[]) AS part);

-- name: clips_holding
SELECT h.distance, h.clip, c.dataset, c.label, c.subject, c.split, c.fps, c.frames, c.format = 'synthetic' AS synthetic
FROM clips_holding(
    $descriptor::FLOAT[512], k := $k, dataset := $dataset, without := $clip, first := $first, last := $last,
    recorded_only := $recorded_only, split := $split, min_quality := $min_quality
) h
JOIN clips c USING (clip)
ORDER BY rank;

-- name: descriptor_clips
SELECT clip, dataset, label, subject, split, fps, frames, format = 'synthetic' AS synthetic, descriptor
FROM descriptors JOIN clips USING (clip)
ORDER BY clip;

-- name: descriptors_near
-- The clips that may be answers and are nearest to a descriptor, with theirs.
WITH near AS (
    SELECT clip, array_distance(descriptor, $descriptor::FLOAT[512]) AS distance
    FROM descriptors JOIN clips USING (clip)
    WHERE ($dataset::VARCHAR IS NULL OR dataset = $dataset) AND ($split::VARCHAR IS NULL OR split = $split)
        AND NOT ($recorded_only AND format = 'synthetic') AND good_enough(clip, $min_quality::VARCHAR)
    ORDER BY distance, clip LIMIT $count
)
SELECT clip, dataset, label, subject, split, fps, frames, format = 'synthetic' AS synthetic, descriptor
FROM near JOIN descriptors USING (clip) JOIN clips USING (clip)
ORDER BY clip;

-- name: descriptor_of
SELECT descriptor FROM descriptors WHERE clip = $clip;

-- name: forget_orphans_of_descriptors
DELETE FROM descriptors WHERE NOT EXISTS (FROM clips c WHERE c.clip = descriptors.clip AND c.part = descriptors.part);

-- name: forget_orphans_of_submotion_parts
DELETE FROM submotion_parts WHERE part NOT IN (SELECT part FROM clips);

-- name: window_files
-- Of every part with windows, the files of their vectors and of their codes, with the keys; NULL where there are none.
SELECT p.part, v.key, v.files[1] AS vectors, w.key AS codes_key, w.files[1] AS codes
FROM submotion_parts p
JOIN manifest v ON v.stage = 'submotions' AND v.state = 'ok' AND v.part = p.part
LEFT JOIN manifest w ON w.stage = 'windows' AND w.state = 'ok' AND w.part = p.part
ORDER BY p.part;

-- name: clips_holding_among
-- As `clips_holding`, of the windows in `rows`, without what the catalog says of the clips.
SELECT min(array_distance(descriptor::FLOAT[512], $descriptor::FLOAT[512])) AS distance, clip
FROM rows
WHERE NOT coalesce(clip = $clip AND start < $last AND stop > $first, false)
GROUP BY clip
ORDER BY distance, clip LIMIT $k;

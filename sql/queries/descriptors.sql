-- name: load_descriptors
DELETE FROM descriptors WHERE model <> $model OR part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO descriptors BY NAME
SELECT s.clip, s.descriptor::FLOAT[512] AS descriptor, $model AS model, s.part
FROM read_parquet($files) s SEMI JOIN clips c ON c.clip = s.clip AND c.part = s.part
ORDER BY clip;

-- name: load_submotions
DELETE FROM submotions WHERE model <> $model OR part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO submotions BY NAME
SELECT s.clip, s.start, s.stop, s.descriptor::FLOAT[512] AS descriptor, $model AS model, s.part
FROM read_parquet($files) s SEMI JOIN clips c ON c.clip = s.clip AND c.part = s.part
ORDER BY clip, start;

-- name: clips_holding
SELECT h.rank, h.clip, h.distance, c.label, c.dataset, c.fps, c.frames
FROM clips_holding($descriptor::FLOAT[512], k := $k, within := $within, without := $clip, first := $first, last := $last) h
JOIN clips c USING (clip)
ORDER BY rank;

-- name: recorded_clips_holding
SELECT h.rank, h.clip, h.distance, c.label, c.dataset, c.fps, c.frames
FROM clips_holding(
    $descriptor::FLOAT[512], k := $k, within := $within, without := $clip, first := $first, last := $last, real := true
) h
JOIN clips c USING (clip)
ORDER BY rank;

-- name: descriptor_clips
SELECT d.clip, c.label, c.dataset, c.seconds, c.format = 'synthetic' AS synthetic, d.descriptor
FROM descriptors d JOIN clips c USING (clip)
ORDER BY clip;

-- name: forget_orphans_of_descriptors
DELETE FROM descriptors WHERE NOT EXISTS (FROM clips c WHERE c.clip = descriptors.clip AND c.part = descriptors.part);

-- name: forget_orphans_of_submotions
DELETE FROM submotions WHERE NOT EXISTS (FROM clips c WHERE c.clip = submotions.clip AND c.part = submotions.part);

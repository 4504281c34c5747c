-- name: classed_motions
-- Recorded motion of known class: clips with a label, and of those without the labelled ranges.
SELECT clip, part, dataset, fps, frames, start, stop, label, content_hash, licence, filled, rest_offsets
FROM (
    SELECT *, 0::BIGINT AS start, frames AS stop FROM clips WHERE label IS NOT NULL
    UNION ALL BY NAME
    SELECT c.* EXCLUDE (label), s.start, s.stop, s.label
    FROM clips c JOIN segments s USING (clip) WHERE c.label IS NULL
)
WHERE format <> 'synthetic' AND ($dataset::VARCHAR IS NULL OR dataset = $dataset)
    AND ($split::VARCHAR IS NULL OR split = $split) AND ($label::VARCHAR IS NULL OR label = $label)
ORDER BY clip, start, stop, label;

-- name: labelled_counts
-- Of every class, how many recorded clips, and labelled ranges of clips without a label, are of it and long enough: so
-- many frames at so many a second; and how many seconds the median of them lasts.
SELECT label, count(*)::BIGINT AS motions, median(length / fps) AS seconds
FROM (
    SELECT label, fps, format, frames AS length FROM clips WHERE label IS NOT NULL
    UNION ALL BY NAME
    SELECT s.label, c.fps, c.format, s.stop - s.start AS length
    FROM clips c JOIN segments s USING (clip) WHERE c.label IS NULL
)
WHERE format <> 'synthetic' AND round_even((length - 1) / fps * $fps, 0) + 1 >= $shortest
GROUP BY label ORDER BY label;

-- name: recorded_motions
-- Recorded clips of any class or none, whole; of a split where one is given.
SELECT clip, part, dataset, fps, frames, 0::BIGINT AS start, frames AS stop, content_hash, licence, rest_offsets
FROM clips
WHERE format <> 'synthetic' AND ($split::VARCHAR IS NULL OR split = $split)
ORDER BY clip;

-- name: synthesis_clips
-- Recorded motion of known class to measure synthesis by: clips, one column of what labels.csv says of them as label,
-- and of clips without a label the labelled ranges.
SELECT clip, dataset, part, fps, split, rest_offsets, start, stop, label
FROM (
    SELECT * EXCLUDE (label), 0::BIGINT AS start, frames AS stop,
        map_concat(attributes, MAP {'label': label, 'subject': subject, 'split': split, 'dataset': dataset})[$column] AS label
    FROM clips
    UNION ALL BY NAME
    SELECT c.* EXCLUDE (label), s.start, s.stop, s.label
    FROM clips c JOIN segments s USING (clip) WHERE c.label IS NULL AND $column = 'label'
)
WHERE label IS NOT NULL AND format <> 'synthetic' AND ($dataset::VARCHAR IS NULL OR dataset = $dataset)
ORDER BY clip, start, stop, label;

-- name: load_synthetic
DELETE FROM synthetic WHERE clip IN (SELECT clip FROM rows);
INSERT INTO synthetic BY NAME FROM rows ORDER BY clip;

-- name: load_synthetic_segments
DELETE FROM segments WHERE clip IN (SELECT unnest($clips::VARCHAR[]));
INSERT INTO segments BY NAME FROM rows ORDER BY ALL;

-- name: synthetic_clip
SELECT * FROM synthetic WHERE clip = $clip;

-- name: synthetic_datasets
SELECT DISTINCT dataset FROM clips WHERE format = 'synthetic' ORDER BY dataset;

-- name: synthetic_keys
SELECT s.clip, s.key FROM synthetic s JOIN clips c USING (clip) WHERE c.dataset = $dataset;

-- name: synthetic_paths
SELECT dataset, path FROM clips WHERE dataset = $dataset AND format = 'synthetic' ORDER BY path;

-- name: forget_orphans_of_synthetic
DELETE FROM synthetic WHERE clip NOT IN (SELECT clip FROM clips WHERE format = 'synthetic');

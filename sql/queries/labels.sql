-- name: load_labels
-- The rows of labels.csv are the truth for the clips below that source folder.
UPDATE clips SET label = r.label, subject = r.subject, split = r.split,
    licence = coalesce(r.licence, $licence), attributes = r.attributes
FROM (
    SELECT s.dataset, s.path, any_value(t.label) AS label, any_value(t.subject) AS subject,
        any_value(t.split) AS split, any_value(t.licence) AS licence,
        coalesce(any_value(t.attributes), MAP {}) AS attributes
    FROM sources s LEFT JOIN rows t ON t.path = s.path
    WHERE s.dataset = $dataset AND s.root = $root
    GROUP BY ALL
) r
WHERE clips.dataset = r.dataset AND clips.path = r.path
    AND (clips.label, clips.subject, clips.split, clips.licence, clips.attributes)
        IS DISTINCT FROM (r.label, r.subject, r.split, coalesce(r.licence, $licence), r.attributes);

-- name: load_segments
DELETE FROM segments
WHERE clip IN (
    SELECT c.clip FROM clips c JOIN sources s ON s.dataset = c.dataset AND s.path = c.path
    WHERE s.dataset = $dataset AND s.root = $root
);
INSERT INTO segments
SELECT c.clip, r.start, least(r.stop, c.frames) AS stop, r.label
FROM rows r JOIN clips c ON c.dataset = $dataset AND c.path = r.path
JOIN sources s ON s.dataset = c.dataset AND s.path = c.path AND s.root = $root
WHERE r.start < c.frames
ORDER BY ALL;

-- name: label_columns
SELECT DISTINCT unnest(list_concat(['label', 'subject', 'split', 'dataset'], map_keys(attributes))) AS name
FROM clips ORDER BY name;

-- name: count_unmatched
SELECT count(*)::BIGINT AS unmatched FROM (SELECT unnest($paths::VARCHAR[]) AS path) p
WHERE p.path NOT IN (SELECT path FROM sources WHERE dataset = $dataset AND root = $root);

-- name: segments_of
SELECT s.clip, s.label, s.start, s.stop FROM segments s JOIN clips c USING (clip)
WHERE $dataset::VARCHAR IS NULL OR c.dataset = $dataset ORDER BY s.clip, s.start, s.stop, s.label;

-- name: segments_of_clip
FROM clip_segments($clip);

-- name: splits
SELECT dataset, split, count(*)::BIGINT AS clips FROM clips WHERE format <> 'synthetic' GROUP BY ALL ORDER BY ALL;

-- name: labelled_clips
-- Clips with a signature, or the recorded ones of them, with one column of what labels.csv says of them, and another to choose by.
SELECT clip, dataset, path, part, fps, subject, signature, says[$column] AS label
FROM (SELECT *, map_concat(attributes, MAP {'label': label, 'subject': subject, 'split': split, 'dataset': dataset}) AS says FROM clips)
JOIN signatures USING (clip)
WHERE NOT ($recorded_only AND format = 'synthetic') AND ($split::VARCHAR IS NULL OR split = $split)
    AND ($dataset::VARCHAR IS NULL OR dataset = $dataset) AND good_enough(clip, $min_quality::VARCHAR)
    AND ($only_column::VARCHAR IS NULL OR says[$only_column::VARCHAR] = $only_value)
ORDER BY clip;

-- name: labelled_strings
-- Clips with a symbol string, or the recorded ones of them, as labelled_clips has them; the signature where there is one.
SELECT clip, dataset, c.part, fps, signature, says[$column] AS label
FROM (SELECT *, map_concat(attributes, MAP {'label': label, 'subject': subject, 'split': split, 'dataset': dataset}) AS says FROM clips) c
JOIN symbol_strings USING (clip) LEFT JOIN signatures USING (clip)
WHERE NOT ($recorded_only AND format = 'synthetic') AND ($split::VARCHAR IS NULL OR split = $split)
    AND ($dataset::VARCHAR IS NULL OR dataset = $dataset) AND good_enough(clip, $min_quality::VARCHAR)
    AND ($only_column::VARCHAR IS NULL OR says[$only_column::VARCHAR] = $only_value)
ORDER BY clip;

-- name: described_clips
-- Recorded clips with a descriptor, one column of what labels.csv says of them as label, and the signature where there is one.
SELECT clip, dataset, c.part, fps, split, descriptor, signature, says[$column] AS label
FROM (SELECT *, map_concat(attributes, MAP {'label': label, 'subject': subject, 'split': split, 'dataset': dataset}) AS says FROM clips) c
JOIN descriptors USING (clip) LEFT JOIN signatures USING (clip)
WHERE format <> 'synthetic' AND says[$column] IS NOT NULL AND ($dataset::VARCHAR IS NULL OR dataset = $dataset)
ORDER BY clip;

-- name: taught_clips
-- What clips teach as a whole: their label, where they have no segments. NULL for datasets and for clips: all that are
-- recorded.
SELECT clip, 0 AS start, frames AS stop,
    map_concat(attributes, MAP {'label': label, 'subject': subject, 'split': split, 'dataset': dataset})[$column] AS taught
FROM clips
WHERE clip IN (SELECT clip FROM signatures) AND clip NOT IN (SELECT clip FROM segments) AND taught IS NOT NULL
    AND (($datasets::VARCHAR[] IS NULL AND $clips::VARCHAR[] IS NULL AND format <> 'synthetic')
        OR list_contains($datasets::VARCHAR[], dataset) OR list_contains($clips::VARCHAR[], clip))
ORDER BY clip;

-- name: taught_segments
-- What clips teach: their segments. NULL for datasets and for clips: all that are recorded.
SELECT s.clip, s.start, s.stop, s.label
FROM segments s JOIN clips c USING (clip)
WHERE clip IN (SELECT clip FROM signatures)
    AND (($datasets::VARCHAR[] IS NULL AND $clips::VARCHAR[] IS NULL AND c.format <> 'synthetic')
        OR list_contains($datasets::VARCHAR[], dataset) OR list_contains($clips::VARCHAR[], clip))
ORDER BY ALL;

-- name: labels_of_recorded
-- One column of what labels.csv says of the recorded clips.
SELECT clip, dataset,
    map_concat(attributes, MAP {'label': label, 'subject': subject, 'split': split, 'dataset': dataset})[$column] AS label
FROM clips WHERE format <> 'synthetic' ORDER BY clip;

-- name: labels_of_files
-- What labels.csv says of the files that clips come from, and the source folder of each.
SELECT c.clip, c.path, s.root, c.label, c.subject, c.split, c.licence, c.attributes
FROM clips c JOIN sources s ON s.dataset = c.dataset AND s.path = c.path ORDER BY c.clip;

-- name: forget_orphans_of_segments
DELETE FROM segments WHERE clip NOT IN (SELECT clip FROM clips);

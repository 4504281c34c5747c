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

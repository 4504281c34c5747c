-- Recorded motion of known class to measure synthesis by: clips, one column of what labels.csv says of them as label,
-- and of clips without a label the labelled ranges.
SELECT clip, dataset, part, fps, split, rest_offsets, start, stop, label
FROM (
    SELECT * EXCLUDE (label), 0::BIGINT AS start, frames AS stop,
        CASE $column WHEN 'label' THEN label WHEN 'subject' THEN subject WHEN 'split' THEN split
            WHEN 'dataset' THEN dataset ELSE attributes[$column] END AS label
    FROM clips
    UNION ALL BY NAME
    SELECT c.* EXCLUDE (label), s.start, s.stop, s.label
    FROM clips c JOIN segments s USING (clip) WHERE c.label IS NULL AND $column = 'label'
)
WHERE label IS NOT NULL AND format <> 'synthetic' AND ($dataset::VARCHAR IS NULL OR dataset = $dataset)
ORDER BY clip, start, stop, label;

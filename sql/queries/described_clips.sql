-- Recorded clips with a descriptor, one column of what labels.csv says of them as label, and the signature where there is one.
SELECT clip, dataset, part, fps, split, content_hash, descriptor, signature, label
FROM (
    SELECT c.clip, c.dataset, c.part, c.fps, c.split, c.content_hash, d.descriptor, s.signature,
        CASE $column WHEN 'label' THEN label WHEN 'subject' THEN subject WHEN 'split' THEN split
            WHEN 'dataset' THEN dataset ELSE attributes[$column] END AS label
    FROM clips c JOIN descriptors d USING (clip) LEFT JOIN signatures s USING (clip)
    WHERE c.format <> 'synthetic'
)
WHERE label IS NOT NULL AND ($dataset::VARCHAR IS NULL OR dataset = $dataset)
ORDER BY clip;

-- Signed clips, or with `real` the recorded ones of them, with one column of what labels.csv says of them, and another to choose by.
SELECT clip, dataset, path, part, fps, subject, signature, label
FROM (
    SELECT c.clip, c.dataset, c.path, c.part, c.fps, c.subject, s.signature,
        CASE $column WHEN 'label' THEN label WHEN 'subject' THEN subject WHEN 'split' THEN split
            WHEN 'dataset' THEN dataset ELSE attributes[$column] END AS label,
        CASE $only_column::VARCHAR WHEN 'label' THEN label WHEN 'subject' THEN subject WHEN 'split' THEN split
            WHEN 'dataset' THEN dataset ELSE attributes[$only_column::VARCHAR] END AS criterion
    FROM clips c JOIN signatures s USING (clip)
    WHERE NOT $real OR c.format <> 'synthetic'
)
WHERE ($dataset::VARCHAR IS NULL OR dataset = $dataset) AND ($only_column::VARCHAR IS NULL OR criterion = $only_value)
ORDER BY clip;

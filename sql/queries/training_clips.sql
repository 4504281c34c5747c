-- Recorded clips to train on: of one dataset, of one split; all where these are NULL.
SELECT clip, part, dataset, fps, frames, label, content_hash
FROM clips
WHERE format <> 'synthetic' AND ($dataset::VARCHAR IS NULL OR dataset = $dataset)
    AND ($split::VARCHAR IS NULL OR split = $split)
ORDER BY clip;

-- Synthetic clips only of a dataset that is named.
SELECT clip, dataset, part, fps, frames, label, subject
FROM clips
WHERE (dataset = $dataset::VARCHAR OR $dataset IS NULL AND format <> 'synthetic') AND ($split::VARCHAR IS NULL OR split = $split)
ORDER BY clip;

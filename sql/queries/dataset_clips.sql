SELECT clip, dataset, part, fps, frames, label, subject
FROM clips
WHERE ($dataset::VARCHAR IS NULL OR dataset = $dataset) AND ($split::VARCHAR IS NULL OR split = $split)
ORDER BY clip;

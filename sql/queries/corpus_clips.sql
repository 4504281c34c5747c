SELECT clip, dataset, label, subject, split, fps, frames, format = 'synthetic' AS synthetic FROM clips
WHERE ($dataset::VARCHAR IS NULL OR dataset = $dataset) AND clip IN (SELECT clip FROM signatures)
ORDER BY clip;

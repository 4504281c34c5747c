SELECT clip, dataset, label, licence, fps, frames, layout, skeleton, up, metres_per_unit FROM clips
WHERE dataset = $dataset AND clip IN (SELECT clip FROM signatures)
ORDER BY clip;

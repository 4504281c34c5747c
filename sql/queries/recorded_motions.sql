-- Recorded clips of any class or none, whole; of a split where one is given.
SELECT clip, part, dataset, fps, frames, 0::BIGINT AS start, frames AS stop, content_hash, licence, rest_offsets
FROM clips
WHERE format <> 'synthetic' AND ($split::VARCHAR IS NULL OR split = $split)
ORDER BY clip;

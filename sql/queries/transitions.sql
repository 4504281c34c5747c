-- The transitions between clips of one dataset, in one order for one content.
SELECT t.* FROM transitions t JOIN clips f ON f.clip = t.from_clip JOIN clips g ON g.clip = t.to_clip
WHERE f.dataset = $dataset AND g.dataset = $dataset
ORDER BY t.from_clip, t.from_frame, t.to_clip, t.to_frame;

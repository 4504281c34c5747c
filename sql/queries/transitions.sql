-- name: load_transitions
DELETE FROM transitions WHERE from_clip IN (SELECT clip FROM clips WHERE dataset = $dataset);
INSERT INTO transitions BY NAME
SELECT * FROM (
    SELECT from_clip, from_frame, from_word, to_clip, to_frame, to_word, distance, context_distance FROM rows
    UNION ALL
    SELECT to_clip, to_frame, to_word, from_clip, from_frame, from_word, distance, context_distance FROM rows
) ORDER BY ALL;

-- name: transition_candidates
-- Of the candidates of all pairs of clips, those among the nearest of the word at either end, a clip counted once.
WITH found AS (
    SELECT * FROM read_parquet($files)
), ends AS (
    SELECT from_clip AS clip, from_word AS word, to_clip AS other, * FROM found
    UNION ALL
    SELECT to_clip AS clip, to_word AS word, from_clip AS other, * FROM found
), nearest AS (
    FROM ends QUALIFY row_number() OVER (
        PARTITION BY clip, word, other ORDER BY distance, from_clip, from_frame, to_clip, to_frame) = 1
), kept AS (
    FROM nearest QUALIFY row_number() OVER (
        PARTITION BY clip, word ORDER BY distance, other, from_clip, from_frame, to_clip, to_frame) <= $per_word
)
SELECT DISTINCT from_clip, from_frame, from_word, to_clip, to_frame, to_word, distance
FROM kept SEMI JOIN signatures a ON a.clip = kept.from_clip SEMI JOIN signatures b ON b.clip = kept.to_clip
ORDER BY from_clip, from_frame, to_clip, to_frame;

-- name: transitions
-- The transitions between clips of one dataset, in one order for one content.
SELECT t.* FROM transitions t JOIN clips f ON f.clip = t.from_clip JOIN clips g ON g.clip = t.to_clip
WHERE f.dataset = $dataset AND g.dataset = $dataset
ORDER BY t.from_clip, t.from_frame, t.to_clip, t.to_frame;

-- name: graph_clips
SELECT clip, dataset, label, licence, fps, frames, layout, skeleton, up, metres_per_unit FROM clips
WHERE dataset = $dataset AND clip IN (SELECT clip FROM signatures)
ORDER BY clip;

-- name: forget_orphans_of_transitions
DELETE FROM transitions
WHERE from_clip NOT IN (SELECT clip FROM words w SEMI JOIN clips c ON c.clip = w.clip AND c.part = w.part)
    OR to_clip NOT IN (SELECT clip FROM words w SEMI JOIN clips c ON c.clip = w.clip AND c.part = w.part);

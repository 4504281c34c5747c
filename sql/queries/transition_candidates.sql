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

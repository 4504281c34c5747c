DELETE FROM transitions WHERE from_clip IN (SELECT clip FROM clips WHERE dataset = $dataset);
INSERT INTO transitions BY NAME
SELECT * FROM (
    SELECT from_clip, from_frame, from_word, to_clip, to_frame, to_word, distance, context_distance FROM rows
    UNION ALL
    SELECT to_clip, to_frame, to_word, from_clip, from_frame, from_word, distance, context_distance FROM rows
) ORDER BY ALL;

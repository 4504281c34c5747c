DELETE FROM signatures WHERE clip IN (SELECT clip FROM clips WHERE part IN (SELECT unnest($parts::VARCHAR[])));
INSERT INTO signatures BY NAME
WITH counts AS (
    SELECT clip, motif, count(*) AS n FROM word_motifs
    WHERE part IN (SELECT unnest($parts::VARCHAR[])) GROUP BY ALL
), weights AS (
    SELECT clip, sum(n)::BIGINT AS words, map_from_entries(list((motif, n * idf) ORDER BY motif)) AS mass,
        list_sum(list(n * idf ORDER BY motif)) AS total
    FROM counts JOIN motifs USING (motif) GROUP BY clip
)
SELECT clip, words,
    list_transform(range((SELECT count(*) FROM motifs)), lambda m: coalesce(mass[m::INTEGER], 0) / total)::FLOAT[] AS signature
FROM weights ORDER BY clip;

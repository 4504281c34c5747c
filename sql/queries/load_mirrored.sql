-- The same weighing as in make_signatures.sql, for the words of mirrored clips.
DELETE FROM mirrored_signatures WHERE clip IN (SELECT clip FROM clips WHERE part IN (SELECT unnest($parts::VARCHAR[])));
INSERT INTO mirrored_signatures BY NAME
WITH counts AS (
    SELECT a.clip, a.motif, count(*) AS n
    FROM read_parquet($files) a SEMI JOIN clips c ON c.clip = a.clip AND c.part = a.part
    GROUP BY ALL
), weights AS (
    SELECT clip, map_from_entries(list((motif, n * idf) ORDER BY motif)) AS mass,
        list_sum(list(n * idf ORDER BY motif)) AS total
    FROM counts JOIN motifs USING (motif) GROUP BY clip
)
SELECT clip,
    list_transform(range((SELECT count(*) FROM motifs)), lambda m: coalesce(mass[m::INTEGER], 0) / total)::FLOAT[] AS signature
FROM weights ORDER BY clip;

-- The same weighing as in make_signatures.sql, for words that are not in the lake.
WITH counts AS (
    SELECT motif, count(*) AS n FROM (SELECT unnest($motifs::INTEGER[]) AS motif) GROUP BY ALL
), weights AS (
    SELECT map_from_entries(list((motif, n * idf) ORDER BY motif)) AS mass,
        list_sum(list(n * idf ORDER BY motif)) AS total
    FROM counts JOIN motifs USING (motif)
)
SELECT list_transform(range((SELECT count(*) FROM motifs)), lambda m: coalesce(mass[m::INTEGER], 0) / total)::FLOAT[] AS signature
FROM weights;

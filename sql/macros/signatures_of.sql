-- Works in plain DuckDB: the tf-idf signature of each clip of a table (its name) with a row (clip, motif) a word, weighed
-- as those of the lake are (Deep Motifs, section 4.2).
CREATE OR REPLACE MACRO signatures_of(found) AS TABLE
WITH counts AS (
    SELECT clip, motif, count(*) AS n FROM query_table(found) GROUP BY ALL
), weights AS (
    SELECT clip, sum(n)::BIGINT AS words, map_from_entries(list((motif, n * idf) ORDER BY motif)) AS mass,
        list_sum(list(n * idf ORDER BY motif)) AS total
    FROM counts JOIN motifs USING (motif) GROUP BY clip
)
SELECT clip, words,
    list_transform(range((SELECT count(*) FROM motifs)), lambda m: coalesce(mass[m::INTEGER], 0) / total)::FLOAT[] AS signature
FROM weights ORDER BY clip;

-- Works in plain DuckDB: clips that share most of their motif mass with a clip (1 is all of it).
CREATE OR REPLACE MACRO overlapping_motifs(query, k) AS TABLE
SELECT s.clip,
    list_sum(list_transform(list_zip(q.signature, s.signature), lambda p: least(p[1], p[2]))) AS shared
FROM signatures s, (SELECT signature FROM signatures WHERE clip = query) q
WHERE s.clip <> query
ORDER BY shared DESC, s.clip LIMIT k;

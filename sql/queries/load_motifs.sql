-- New motifs: their document frequencies are those of the recorded clips as they stand, and stay as they are.
INSERT INTO motifs BY NAME
WITH recorded AS (
    SELECT * FROM word_motifs SEMI JOIN clips c ON c.clip = word_motifs.clip AND c.format <> 'synthetic'
)
SELECT m.motif, $model AS model, m.centroid, count(w.clip)::BIGINT AS words,
    count(DISTINCT w.clip)::BIGINT AS clips, m.strength,
    ln((1 + (SELECT count(DISTINCT clip) FROM recorded)) / (1 + count(DISTINCT w.clip))) + 1 AS idf
FROM read_parquet($motifs) m LEFT JOIN recorded w ON w.motif = m.motif
GROUP BY m.motif, m.centroid, m.strength
ORDER BY m.motif;

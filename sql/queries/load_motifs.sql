-- New motifs: their document frequencies are those of the lake as it stands, and stay as they are.
INSERT INTO motifs BY NAME
SELECT m.motif, $model AS model, m.centroid, count(w.clip)::BIGINT AS words,
    count(DISTINCT w.clip)::BIGINT AS clips, m.strength,
    ln((1 + (SELECT count(DISTINCT clip) FROM word_motifs)) / (1 + count(DISTINCT w.clip))) + 1 AS idf
FROM read_parquet($motifs) m LEFT JOIN word_motifs w ON w.motif = m.motif
GROUP BY m.motif, m.centroid, m.strength
ORDER BY m.motif;

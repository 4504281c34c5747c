DELETE FROM word_motifs WHERE part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO word_motifs BY NAME
FROM read_parquet($files) a SEMI JOIN clips c ON c.clip = a.clip AND c.part = a.part
ORDER BY clip, word;

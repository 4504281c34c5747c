DELETE FROM words WHERE part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO words BY NAME
FROM read_parquet($files) w SEMI JOIN clips c ON c.clip = w.clip AND c.part = w.part
ORDER BY clip, word;

DELETE FROM symbol_strings WHERE part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO symbol_strings BY NAME
FROM read_parquet($files) s SEMI JOIN clips c ON c.clip = s.clip AND c.part = s.part
ORDER BY clip;

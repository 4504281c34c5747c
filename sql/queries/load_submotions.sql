DELETE FROM submotions WHERE model <> $model OR part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO submotions BY NAME
SELECT s.clip, s.start, s.stop, s.descriptor::FLOAT[512] AS descriptor, $model AS model, s.part
FROM read_parquet($files) s SEMI JOIN clips c ON c.clip = s.clip AND c.part = s.part
ORDER BY clip, start;

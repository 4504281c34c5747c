-- A new dictionary: how often the lake as it stands has each posture.
INSERT INTO postures BY NAME
WITH counts AS (
    SELECT k.symbol, count(*)::BIGINT AS frames
    FROM read_parquet($codes) k SEMI JOIN clips c ON c.clip = k.clip AND c.part = k.part
    GROUP BY k.symbol
)
SELECT r.symbol, $model AS model, r.code, r.posture, coalesce(n.frames, 0) AS frames,
    coalesce(n.frames, 0) / (SELECT sum(frames) FROM counts) AS share
FROM rows r LEFT JOIN counts n USING (symbol)
ORDER BY r.symbol;

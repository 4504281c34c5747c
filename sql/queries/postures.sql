-- name: load_postures
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

-- name: load_symbols
DELETE FROM symbol_strings WHERE part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO symbol_strings BY NAME
FROM read_parquet($files) s SEMI JOIN clips c ON c.clip = s.clip AND c.part = s.part
ORDER BY clip;

-- name: clear_symbols
DELETE FROM postures;
DELETE FROM symbol_strings;

-- name: posture_codes
SELECT model, code FROM postures ORDER BY symbol;

-- name: posture_shares
SELECT share FROM postures ORDER BY symbol;

-- name: symbol_strings
SELECT clip, dataset, label, subject, split, fps, frames, format = 'synthetic' AS synthetic, symbols, starts
FROM symbol_strings JOIN clips USING (clip)
WHERE $clips::VARCHAR[] IS NULL OR clip IN (SELECT unnest($clips::VARCHAR[]))
ORDER BY clip;

-- name: forget_orphans_of_symbol_strings
DELETE FROM symbol_strings
WHERE NOT EXISTS (FROM clips c WHERE c.clip = symbol_strings.clip AND c.part = symbol_strings.part);

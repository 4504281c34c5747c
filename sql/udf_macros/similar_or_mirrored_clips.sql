-- The clips most like one of the lake or like its mirror image, whichever is nearer. `real`: synthetic clips are
-- left out.
CREATE OR REPLACE TEMP MACRO clips_like_either(
    query_signature, mirrored_signature, k, within := NULL, without := NULL, real := false
) AS TABLE
WITH found AS (
    SELECT clip, distance, false AS mirrored, label, dataset, seconds
    FROM clips_like(query_signature, k, within := within, without := without, real := real)
    UNION ALL
    SELECT clip, distance, true AS mirrored, label, dataset, seconds
    FROM clips_like(mirrored_signature, k, within := within, without := without, real := real)
), nearest AS (
    FROM found QUALIFY row_number() OVER (PARTITION BY clip ORDER BY distance, mirrored) = 1
)
SELECT row_number() OVER (ORDER BY distance, clip) AS rank, clip, distance, label, dataset, seconds, mirrored
FROM nearest ORDER BY distance, clip LIMIT k;

CREATE OR REPLACE TEMP MACRO similar_or_mirrored_clips(query, k := 10, within := NULL, real := false) AS TABLE
FROM clips_like_either(
    (SELECT signature FROM signatures WHERE clip = query),
    (SELECT signature FROM mirrored_signatures WHERE clip = query),
    k, within := within, without := query, real := real
);

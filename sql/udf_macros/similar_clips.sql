-- The clips most like one of the lake, by the earth mover's distance between signatures (Deep Motifs, section 4.3).
-- `model` names the motifs that the signature was made with: others than the lake's are an error. `real`: synthetic
-- clips are left out.
CREATE OR REPLACE TEMP MACRO clips_like(
    query_signature, k, within := NULL, without := NULL, model := NULL, real := false
) AS TABLE
SELECT row_number() OVER (ORDER BY distance, clip) AS rank, clip, distance, label, dataset, seconds
FROM (
    SELECT unnest(
        nearest_signatures(
            query_signature::FLOAT[], k::BIGINT, within::VARCHAR, without::VARCHAR, model::VARCHAR, real::BOOLEAN
        ), recursive := true
    )
)
JOIN clips USING (clip)
ORDER BY distance, clip;

CREATE OR REPLACE TEMP MACRO similar_clips(query, k := 10, within := NULL, real := false) AS TABLE
FROM clips_like(
    (SELECT signature FROM signatures WHERE clip = query), k, within := within, without := query, real := real
);

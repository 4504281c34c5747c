-- The clips most like one of the lake, by the earth mover's distance between signatures (Deep Motifs, section 4.3).
CREATE OR REPLACE TEMP MACRO clips_like(query_signature, k, within := NULL, without := NULL) AS TABLE
SELECT row_number() OVER (ORDER BY distance, clip) AS rank, clip, distance, label, dataset, seconds
FROM (
    SELECT clip, emd(signature, query_signature::FLOAT[]) AS distance, label, dataset, seconds
    FROM signatures JOIN clips USING (clip)
    WHERE (within IS NULL OR dataset = within) AND (without IS NULL OR clip <> without)
)
ORDER BY distance, clip LIMIT k;

CREATE OR REPLACE TEMP MACRO similar_clips(query, k := 10, within := NULL) AS TABLE
FROM clips_like((SELECT signature FROM signatures WHERE clip = query), k, within := within, without := query);

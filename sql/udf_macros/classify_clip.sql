-- The class of a clip by a vote of its k nearest labelled, recorded clips (Deep Motifs, section 4.3); a tie goes to the nearest.
CREATE OR REPLACE TEMP MACRO classify_clip(query, k := 5, within := NULL) AS TABLE
WITH found AS (
    SELECT unnest(
        nearest_signatures(
            (SELECT signature FROM signatures WHERE clip = query)::FLOAT[], NULL, within::VARCHAR, query::VARCHAR, NULL, true
        ), recursive := true
    )
), voters AS (
    SELECT label, distance, row_number() OVER (ORDER BY distance, clip) AS rank
    FROM found JOIN clips USING (clip) WHERE label IS NOT NULL ORDER BY rank LIMIT k
)
SELECT label, count(*) / sum(count(*)) OVER () AS confidence, (SELECT min(distance) FROM voters) AS distance
FROM voters GROUP BY label ORDER BY count(*) DESC, min(rank) LIMIT 1;

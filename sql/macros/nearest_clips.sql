-- Works in plain DuckDB: the clips whose descriptors are nearest to a given one (DeepHuMS, section 3.2). `real`:
-- synthetic clips are left out.
CREATE OR REPLACE MACRO clips_near(query_descriptor, k := 10, within := NULL, without := NULL, real := false) AS TABLE
SELECT row_number() OVER (ORDER BY distance, clip) AS rank, clip, distance, label, dataset, seconds
FROM (
    SELECT clip, distance, label, dataset, seconds
    FROM (
        SELECT d.clip, array_distance(d.descriptor, q.descriptor) AS distance
        FROM descriptors d, (SELECT query_descriptor::FLOAT[512] AS descriptor) q
        WHERE q.descriptor IS NOT NULL
    ) JOIN clips USING (clip)
    WHERE (within IS NULL OR dataset = within) AND (without IS NULL OR clip <> without)
        AND (NOT real OR format <> 'synthetic')
    ORDER BY distance, clip LIMIT k
)
ORDER BY distance, clip;

CREATE OR REPLACE MACRO nearest_clips(query, k := 10, within := NULL, real := false) AS TABLE
FROM clips_near(
    (SELECT descriptor FROM descriptors WHERE clip = query), k := k, within := within, without := query, real := real
);

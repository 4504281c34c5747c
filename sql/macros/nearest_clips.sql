-- Works in plain DuckDB: the clips whose descriptors are nearest to a given one (DeepHuMS, section 3.2). `dataset` and
-- `split`: of these only; `recorded_only`: no synthetic clips; `min_quality`: at least so good (`good_enough`); `without`:
-- not this clip.
CREATE OR REPLACE MACRO clips_near(
    query_descriptor, k := 10, dataset := NULL, without := NULL, recorded_only := false, split := NULL, min_quality := NULL
) AS TABLE
SELECT row_number() OVER (ORDER BY distance, clip) AS rank, clip, distance, label, home AS dataset, seconds
FROM (
    SELECT c.clip, array_distance(d.descriptor, q.descriptor) AS distance, c.label, c.dataset AS home, c.seconds
    FROM (SELECT query_descriptor::FLOAT[512] AS descriptor) q, descriptors d JOIN clips c ON c.clip = d.clip
    WHERE q.descriptor IS NOT NULL AND (dataset IS NULL OR c.dataset = dataset) AND (split IS NULL OR c.split = split)
        AND (without IS NULL OR c.clip <> without) AND NOT (recorded_only AND c.format = 'synthetic')
        AND good_enough(c.clip, min_quality)
    ORDER BY distance, c.clip LIMIT k
)
ORDER BY distance, clip;

CREATE OR REPLACE MACRO nearest_clips(
    query, k := 10, dataset := NULL, recorded_only := false, split := NULL, min_quality := NULL
) AS TABLE
FROM clips_near(
    (SELECT descriptor FROM descriptors WHERE clip = clip_named(query)), k := k, dataset := dataset,
    without := clip_named(query), recorded_only := recorded_only, split := split,
    min_quality := min_quality
);

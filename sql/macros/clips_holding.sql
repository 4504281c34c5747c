-- Works in plain DuckDB: the clips of which a window is nearest to a piece of motion, as the second network sees it
-- (DeepHuMS, section 3.3.5), and that window. `without`: windows of this clip that overlap its frames [first, last) are
-- left out; `real`: so are synthetic clips.
CREATE OR REPLACE MACRO clips_holding(
    query_descriptor, k := 10, within := NULL, without := NULL, first := NULL, last := NULL, real := false
) AS TABLE
SELECT row_number() OVER (ORDER BY distance, clip) AS rank, clip, "start", stop, distance, label, dataset, seconds
FROM (
    SELECT clip, near.start AS "start", near.stop AS stop, near.distance AS distance, label, dataset, seconds
    FROM (
        SELECT clip, min({distance: array_distance(s.descriptor, q.descriptor), start: s.start, stop: s.stop}) AS near
        FROM submotions s, (SELECT query_descriptor::FLOAT[512] AS descriptor) q
        WHERE q.descriptor IS NOT NULL
            AND NOT coalesce(clip = without AND s.start < last AND s.stop > first, false)
        GROUP BY clip
    ) JOIN clips USING (clip)
    WHERE (within IS NULL OR dataset = within) AND (NOT real OR format <> 'synthetic')
    ORDER BY distance, clip LIMIT k
)
ORDER BY distance, clip;

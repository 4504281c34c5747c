-- Windows of clips as the sub-motion encoder sees them; frames are the clip's own. A part may outlive its use for a
-- moment: only parts the manifest names, of clips that the lake holds, count.
CREATE OR REPLACE VIEW submotions AS
SELECT s.clip, s.start, s.stop, s.descriptor::FLOAT[512] AS descriptor, p.model, s.part
FROM read_parquet(live_files('submotions', 'submotions/*.parquet')) s
JOIN submotion_parts p ON p.part = s.part
SEMI JOIN manifest m ON m.stage = 'submotions' AND m.state = 'ok' AND m.key = s.key
SEMI JOIN clips c ON c.clip = s.clip AND c.part = s.part;

-- Works in plain DuckDB: the clips of which a window is nearest to a piece of motion, as the sub-motion encoder sees it
-- (DeepHuMS, section 3.3.5), and that window. `without`: windows of this clip that overlap its frames [first, last) are
-- left out; `dataset`, `split`, `recorded_only`, `min_quality`: as in `clips_near`.
CREATE OR REPLACE MACRO clips_holding(
    query_descriptor, k := 10, dataset := NULL, without := NULL, first := NULL, last := NULL, recorded_only := false,
    split := NULL, min_quality := NULL
) AS TABLE
SELECT row_number() OVER (ORDER BY distance, clip) AS rank, clip, "start", stop, distance, label, home AS dataset, seconds
FROM (
    SELECT c.clip, near.start AS "start", near.stop AS stop, near.distance AS distance, c.label, c.dataset AS home, c.seconds
    FROM (
        SELECT clip, min({distance: array_distance(s.descriptor, q.descriptor), start: s.start, stop: s.stop}) AS near
        FROM submotions s, (SELECT query_descriptor::FLOAT[512] AS descriptor) q
        WHERE q.descriptor IS NOT NULL
            AND NOT coalesce(clip = without AND s.start < last AND s.stop > first, false)
        GROUP BY clip
    ) n JOIN clips c ON c.clip = n.clip
    WHERE (dataset IS NULL OR c.dataset = dataset) AND (split IS NULL OR c.split = split)
        AND NOT (recorded_only AND c.format = 'synthetic') AND good_enough(c.clip, min_quality)
    ORDER BY near.distance, c.clip LIMIT k
)
ORDER BY distance, clip;

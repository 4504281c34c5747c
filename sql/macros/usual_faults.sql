-- The rows of stage "quality"; where the stage has run, its view puts another one in place of this.
CREATE OR REPLACE MACRO checked_clips() AS TABLE
SELECT NULL::VARCHAR AS clip,
    NULL::STRUCT(fault VARCHAR, joint VARCHAR, start BIGINT, stop BIGINT, severity DOUBLE)[] AS ranges,
    NULL::STRUCT(
        fault VARCHAR, joint VARCHAR, start BIGINT, stop BIGINT, rung BIGINT, level DOUBLE, severity DOUBLE
    )[] AS levels
WHERE false;

-- Faults that are usual in a dataset of `fewest` clips or more: at least half of its clips have them above the threshold.
-- A row a joint: `clips` of the dataset, `faulty` ones of them, `median` of how many times the threshold each clip goes,
-- and `highest`, the multiple of the threshold above which one stands out at this joint. What is usual of a joint is the
-- 75 % quantile over the clips (the threshold, where that is more); a clip's score is its most, over that, at any joint;
-- it stands out by `spreads` robust standard deviations (1.4826 times the median deviation) over the median score.
-- What it reads is `checked_clips`, so that it follows the dataset as that grows.
CREATE OR REPLACE MACRO usual_faults(spreads := 0.5, fewest := 20) AS TABLE
WITH checked AS (SELECT c.dataset, q.clip, q.levels FROM checked_clips() q JOIN clips c ON c.clip = q.clip),
sizes AS (SELECT dataset, count(*)::BIGINT AS clips FROM checked GROUP BY dataset),
each AS (SELECT dataset, clip, unnest(levels) AS l FROM checked),
peaks AS (
    SELECT dataset, clip, l.fault AS fault, l.joint AS joint, max(l.level) AS level FROM each WHERE l.rung = 0
    GROUP BY ALL
),
worst AS (SELECT dataset, fault, clip, max(level) AS level FROM peaks GROUP BY ALL),
counted AS (
    SELECT w.dataset, w.fault, s.clips, count(*)::BIGINT AS faulty,
        list_median(list_resize(list(w.level), s.clips, 0.0::DOUBLE)) AS median
    FROM worst w JOIN sizes s ON s.dataset = w.dataset
    GROUP BY w.dataset, w.fault, s.clips
),
common AS (SELECT * FROM counted WHERE clips >= fewest AND 2 * faulty >= clips),
joints AS (
    SELECT p.dataset, p.fault, p.joint,
        greatest(1, list_aggregate(list_resize(list(p.level), c.clips, 0.0::DOUBLE), 'quantile_cont', 0.75)) AS level
    FROM peaks p JOIN common c ON c.dataset = p.dataset AND c.fault = p.fault
    GROUP BY p.dataset, p.fault, p.joint, c.clips
),
scores AS (
    SELECT p.dataset, p.fault, p.clip, max(p.level / j.level) AS score
    FROM peaks p JOIN joints j ON j.dataset = p.dataset AND j.fault = p.fault AND j.joint = p.joint
    GROUP BY ALL
),
limits AS (
    SELECT s.dataset, s.fault, list_resize(list(s.score), c.clips, 0.0::DOUBLE) AS scores
    FROM scores s JOIN common c ON c.dataset = s.dataset AND c.fault = s.fault
    GROUP BY s.dataset, s.fault, c.clips
)
SELECT c.dataset, c.fault, j.joint, c.clips, c.faulty, c.median,
    greatest(1, j.level * (list_median(l.scores) + spreads * 1.4826 * list_aggregate(l.scores, 'mad'))) AS highest
FROM common c
JOIN joints j ON j.dataset = c.dataset AND j.fault = c.fault
JOIN limits l ON l.dataset = c.dataset AND l.fault = c.fault;

-- Ranges of levels are kept at two multiples of the threshold in each doubling: the last one that is not above this one.
CREATE OR REPLACE MACRO fault_rung(multiple) AS floor(2 * log2(multiple))::BIGINT;

-- Faults by range, without those that are usual in their dataset and do not stand out there.
CREATE OR REPLACE MACRO unusual_faults(spreads := 0.5, fewest := 20) AS TABLE
WITH usual AS MATERIALIZED (FROM usual_faults(spreads := spreads, fewest := fewest)),
checked AS (SELECT c.dataset, q.clip, q.ranges, q.levels FROM checked_clips() q JOIN clips c ON c.clip = q.clip),
ranges AS (SELECT dataset, clip, unnest(ranges, recursive := true) FROM checked),
levels AS (SELECT dataset, clip, unnest(levels, recursive := true) FROM checked)
SELECT r.clip, r.fault, r.joint, r.start, r.stop, r.severity
FROM ranges r ANTI JOIN usual u ON u.dataset = r.dataset AND u.fault = r.fault
UNION ALL
SELECT l.clip, l.fault, l.joint, l.start, l.stop, l.severity
FROM levels l JOIN usual u ON u.dataset = l.dataset AND u.fault = l.fault AND u.joint = l.joint
WHERE l.level > u.highest AND l.rung = fault_rung(u.highest);

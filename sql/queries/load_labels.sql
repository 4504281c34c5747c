-- The rows of labels.csv are the truth for the clips below that source folder.
UPDATE clips SET label = r.label, subject = r.subject, split = r.split,
    licence = coalesce(r.licence, $licence), attributes = r.attributes
FROM (
    SELECT s.dataset, s.path, any_value(t.label) AS label, any_value(t.subject) AS subject,
        any_value(t.split) AS split, any_value(t.licence) AS licence,
        coalesce(any_value(t.attributes), MAP {}) AS attributes
    FROM sources s LEFT JOIN rows t ON t.path = s.path
    WHERE s.dataset = $dataset AND s.root = $root
    GROUP BY ALL
) r
WHERE clips.dataset = r.dataset AND clips.path = r.path
    AND (clips.label, clips.subject, clips.split, clips.licence, clips.attributes)
        IS DISTINCT FROM (r.label, r.subject, r.split, coalesce(r.licence, $licence), r.attributes);

-- name: clip_texts
-- What clips say of themselves, a line a part, without numbers: many clips say the same then.
SELECT clip, dataset, label, subject, split, fps, frames, format = 'synthetic' AS synthetic,
    regexp_replace(concat_ws(
        chr(10), label, array_to_string(map_values(attributes), chr(10)), said, subject,
        replace(regexp_replace(clip, '\.[A-Za-z0-9]+(\.gz)?(#.*)?$', ''), '/', chr(10))
    ), '[0-9]+', ' ', 'g') AS says
FROM clips LEFT JOIN (SELECT clip, string_agg(DISTINCT label, chr(10) ORDER BY label) AS said FROM segments GROUP BY clip)
USING (clip)
ORDER BY clip;

-- name: said_by_clips
-- The same of some clips as it stands there, by where: the columns of labels.csv, segments, and the name.
SELECT clip, map_concat(attributes, MAP {'label': label, 'subject': subject}) AS columns, coalesce(segments, []) AS segments
FROM clips LEFT JOIN (SELECT clip, list(DISTINCT label ORDER BY label) AS segments FROM segments GROUP BY clip) USING (clip)
WHERE clip IN (SELECT unnest($clips::VARCHAR[]));

-- What clips teach as a whole: their label, where they have no segments. NULL for datasets and for clips: all that are
-- recorded.
SELECT clip, 0 AS start, frames AS stop,
    CASE $column WHEN 'label' THEN label WHEN 'subject' THEN subject WHEN 'split' THEN split
        WHEN 'dataset' THEN dataset ELSE attributes[$column] END AS taught
FROM clips
WHERE clip IN (SELECT clip FROM signatures) AND clip NOT IN (SELECT clip FROM segments) AND taught IS NOT NULL
    AND (($datasets::VARCHAR[] IS NULL AND $clips::VARCHAR[] IS NULL AND format <> 'synthetic')
        OR list_contains($datasets::VARCHAR[], dataset) OR list_contains($clips::VARCHAR[], clip))
ORDER BY clip;

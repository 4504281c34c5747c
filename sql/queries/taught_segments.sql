-- What clips teach: their segments. NULL for datasets and for clips: all that are recorded.
SELECT s.clip, s.start, s.stop, s.label
FROM segments s JOIN clips c USING (clip)
WHERE clip IN (SELECT clip FROM signatures)
    AND (($datasets::VARCHAR[] IS NULL AND $clips::VARCHAR[] IS NULL AND c.format <> 'synthetic')
        OR list_contains($datasets::VARCHAR[], dataset) OR list_contains($clips::VARCHAR[], clip))
ORDER BY ALL;

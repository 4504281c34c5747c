DELETE FROM segments
WHERE clip IN (
    SELECT c.clip FROM clips c JOIN sources s ON s.dataset = c.dataset AND s.path = c.path
    WHERE s.dataset = $dataset AND s.root = $root
);
INSERT INTO segments
SELECT c.clip, r.start, least(r.stop, c.frames) AS stop, r.label
FROM rows r JOIN clips c ON c.dataset = $dataset AND c.path = r.path
JOIN sources s ON s.dataset = c.dataset AND s.path = c.path AND s.root = $root
WHERE r.start < c.frames
ORDER BY ALL;

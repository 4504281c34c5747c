SELECT clip, dataset, part, s.signature, m.signature AS mirrored
FROM clips JOIN signatures s USING (clip) LEFT JOIN mirrored_signatures m USING (clip)
WHERE NOT $real OR format <> 'synthetic'
ORDER BY clip;

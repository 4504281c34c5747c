-- Where frames [start, stop) of a clip, a motion of at least two words, occur inside the clips (Deep Motifs,
-- section 6.1). NULL for start or stop: from the first frame, to the last. `mirrored`: its mirror image too. `real`: synthetic
-- clips are left out.
CREATE OR REPLACE TEMP MACRO find_motion(query, start, stop, k := 10, within := NULL, mirrored := false, real := false) AS TABLE
FROM (
    SELECT unnest(
        find_ranges(query, start::BIGINT, stop::BIGINT, k::BIGINT, within::VARCHAR, mirrored::BOOLEAN, real::BOOLEAN),
        recursive := true
    )
)
ORDER BY rank;

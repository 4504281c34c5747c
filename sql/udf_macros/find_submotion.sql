-- The clips that hold a motion like frames [start, stop) of a clip, and where in them it lies (DeepHuMS, section 3.3.5).
-- NULL for start or stop: from the first frame, to the last. `own`: these frames themselves may be an answer.
-- `real`: synthetic clips are left out.
CREATE OR REPLACE TEMP MACRO find_submotion(query, start, stop, k := 10, within := NULL, own := false, real := false) AS TABLE
FROM (
    SELECT unnest(
        find_pieces(query, start::BIGINT, stop::BIGINT, k::BIGINT, within::VARCHAR, own::BOOLEAN, real::BOOLEAN),
        recursive := true
    )
)
ORDER BY rank;

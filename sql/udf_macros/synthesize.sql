-- The frames of a motion that a generator makes, of one class or of several one after the other: 'walk' or
-- ['walk', 'kick']. A row a frame, with the columns of `frames`, the time, the class and the recorded clip that it goes on
-- from. The first motion of `motionlake synthesize` with the same options. `start`: that clip; `split`: its split.
CREATE OR REPLACE TEMP MACRO synthesize(
    classes, seconds := 8, seed := 0, start := NULL, split := NULL, pace := 1, temperature := 1
) AS TABLE
FROM (
    SELECT unnest(
        synthesized_frames(
            coalesce(try_cast(classes AS VARCHAR[]), [classes::VARCHAR]), seconds::DOUBLE, seed::BIGINT, start::VARCHAR,
            split::VARCHAR, pace::DOUBLE, temperature::DOUBLE
        ), recursive := true
    )
)
ORDER BY frame;

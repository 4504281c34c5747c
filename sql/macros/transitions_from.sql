-- Works in plain DuckDB: where a clip can be left for another, with times in seconds, nearest first.
CREATE OR REPLACE MACRO transitions_from(name) AS TABLE
SELECT t.from_frame, t.from_frame / f.fps AS from_seconds, t.to_clip, t.to_frame, t.to_frame / g.fps AS to_seconds,
    t.distance, t.context_distance
FROM transitions t JOIN clips f ON f.clip = t.from_clip JOIN clips g ON g.clip = t.to_clip
WHERE t.from_clip = name ORDER BY t.distance, t.from_frame, t.to_clip, t.to_frame;

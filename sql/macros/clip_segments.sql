-- Works in plain DuckDB: the frame-level labels of a clip, with their times in seconds.
CREATE OR REPLACE MACRO clip_segments(name) AS TABLE
SELECT s.label, s.start, s.stop, s.start / c.fps AS start_seconds, s.stop / c.fps AS stop_seconds
FROM segments s JOIN clips c USING (clip)
WHERE clip = name ORDER BY s.start, s.stop, s.label;

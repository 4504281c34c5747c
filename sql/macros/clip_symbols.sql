-- Works in plain DuckDB: the string of a clip, where each symbol starts and stops, with times in seconds.
CREATE OR REPLACE MACRO clip_symbols(name) AS TABLE
SELECT s.position, s.symbol, s.start, s.stop, s.start / c.fps AS start_seconds, s.stop / c.fps AS stop_seconds
FROM (
    SELECT clip, unnest(range(len(symbols)))::INTEGER AS position, unnest(symbols) AS symbol, unnest(starts) AS start,
        unnest(list_append(starts[2:], (SELECT frames FROM clips WHERE clip = name))) AS stop
    FROM symbol_strings WHERE clip = name
) s JOIN clips c USING (clip)
ORDER BY s.position;

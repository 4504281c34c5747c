-- The verdict of stage "quality" on a clip; where the stage has run, its view puts another one in place of this.
CREATE OR REPLACE MACRO quality_verdict(name) AS NULL::VARCHAR;

-- Works in plain DuckDB: whether a clip is at least "ok" or "doubtful"; NULL for the least: any clip is.
CREATE OR REPLACE MACRO good_enough(name, least) AS CASE
    WHEN least IS NULL THEN true
    WHEN least NOT IN ('ok', 'doubtful') THEN error('min_quality ' || least || ': use ok or doubtful')
    ELSE coalesce(
        quality_verdict(name) IN ('ok', least),
        error(name || ': has no verdict yet; make it with `motionlake run quality`')
    )
END;

-- Where frames [start, stop) of a clip occur inside the clips, by strided temporal alignment (PESTA, section 6). NULL for
-- start or stop: from the first frame, to the last. `stride`, `method` ('sta', 'dtw', 'sw'): others than config.toml's.
-- `real`: synthetic clips are left out.
CREATE OR REPLACE TEMP MACRO align_motion(
    query, start, stop, k := 10, within := NULL, stride := NULL, method := NULL, real := false
) AS TABLE
FROM (
    SELECT unnest(
        align_ranges(
            query::VARCHAR, start::BIGINT, stop::BIGINT, k::BIGINT, within::VARCHAR, stride::BIGINT, method::VARCHAR,
            real::BOOLEAN
        ), recursive := true
    )
)
ORDER BY rank;

-- The same for a list of symbols; `model` names their dictionary: another than the lake's is an error.
CREATE OR REPLACE TEMP MACRO align_symbols(
    query_symbols, k := 10, within := NULL, stride := NULL, method := NULL, model := NULL, real := false
) AS TABLE
FROM (
    SELECT unnest(
        align_strings(
            query_symbols::INTEGER[], model::VARCHAR, k::BIGINT, within::VARCHAR, stride::BIGINT, method::VARCHAR,
            real::BOOLEAN
        ), recursive := true
    )
)
ORDER BY rank;

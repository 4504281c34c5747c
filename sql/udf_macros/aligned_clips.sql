-- The clips nearest to a whole one, by strided temporal alignment both ways (PESTA, section 6), for each symbol. `real`:
-- synthetic clips are left out.
CREATE OR REPLACE TEMP MACRO aligned_clips(query, k := 10, within := NULL, stride := NULL, method := NULL, real := false) AS TABLE
FROM (
    SELECT unnest(
        align_wholes(query::VARCHAR, k::BIGINT, within::VARCHAR, stride::BIGINT, method::VARCHAR, real::BOOLEAN),
        recursive := true
    )
)
ORDER BY rank;

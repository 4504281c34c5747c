-- Pairs of clips that are one recording: exported again, resampled, cut, or mirrored. `max_distance`: what may
-- differ, as a part of the movement; `within`: a dataset; `across`: only pairs of two datasets.
CREATE OR REPLACE TEMP MACRO near_duplicates(
    max_distance := 0.1, within := NULL, across := false, mirrored := false
) AS TABLE
FROM (
    SELECT unnest(
        near_duplicate_pairs(max_distance::DOUBLE, within::VARCHAR, across::BOOLEAN, mirrored::BOOLEAN), recursive := true
    )
)
ORDER BY distance, clip, other;

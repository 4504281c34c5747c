-- The classes along a clip (Deep Motifs, section 6.2), learned from the segments and labels of other clips: those of
-- `teach` (datasets) and `teach_clips`, or of the whole lake. `mirrored`: from their mirror images too.
CREATE OR REPLACE TEMP MACRO segment_clip(query, teach := NULL, teach_clips := NULL, mirrored := true) AS TABLE
FROM (
    SELECT unnest(
        segment_bands(query, teach::VARCHAR[], teach_clips::VARCHAR[], mirrored::BOOLEAN), recursive := true
    )
)
ORDER BY start;

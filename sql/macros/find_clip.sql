-- The clips a person may mean by a name: the full name, or the end of it, with or without its suffix. `contains` alone is
-- asked of all clips.
CREATE OR REPLACE MACRO find_clip(name) AS TABLE
SELECT clip FROM clips
WHERE clip = name
   OR (NOT EXISTS (FROM clips WHERE clip = name)
       AND contains(clip, '/' || name)
       AND (ends_with(clip, '/' || name) OR ends_with(regexp_replace(clip, '\.[A-Za-z0-9]+(\.gz)?(#.*)?$', ''), '/' || name)))
ORDER BY clip;

-- The one clip that a name means; an error where it is none or several.
CREATE OR REPLACE MACRO clip_named(name) AS (
    SELECT CASE count(*)
        WHEN 1 THEN min(clip)
        WHEN 0 THEN error(name || ': no such clip in the lake')
        ELSE error(name || ': means ' || count(*) || ' clips: ' || string_agg(clip, ', ' ORDER BY clip) || '; name one in full')
    END
    FROM find_clip(name)
);

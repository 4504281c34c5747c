-- The clips a person may mean by a name: the full name, or the end of it, with or without its suffix.
CREATE OR REPLACE MACRO find_clip(name) AS TABLE
SELECT clip FROM clips
WHERE clip = name
   OR (NOT EXISTS (FROM clips WHERE clip = name)
       AND (ends_with(clip, '/' || name) OR ends_with(regexp_replace(clip, '\.[A-Za-z0-9]+(\.gz)?(#.*)?$', ''), '/' || name)))
ORDER BY clip;

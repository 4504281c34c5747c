-- Derived rows of clips that are gone or have moved to another part.
DELETE FROM words WHERE NOT EXISTS (FROM clips c WHERE c.clip = words.clip AND c.part = words.part);
DELETE FROM word_motifs WHERE NOT EXISTS (FROM clips c WHERE c.clip = word_motifs.clip AND c.part = word_motifs.part);
DELETE FROM signatures WHERE clip NOT IN (SELECT clip FROM words);
DELETE FROM mirrored_signatures WHERE clip NOT IN (SELECT clip FROM words);
DELETE FROM transitions WHERE from_clip NOT IN (SELECT clip FROM words) OR to_clip NOT IN (SELECT clip FROM words);
DELETE FROM symbol_strings
WHERE NOT EXISTS (FROM clips c WHERE c.clip = symbol_strings.clip AND c.part = symbol_strings.part);
DELETE FROM descriptors WHERE NOT EXISTS (FROM clips c WHERE c.clip = descriptors.clip AND c.part = descriptors.part);
DELETE FROM submotions WHERE NOT EXISTS (FROM clips c WHERE c.clip = submotions.clip AND c.part = submotions.part);
DELETE FROM synthetic WHERE clip NOT IN (SELECT clip FROM clips WHERE format = 'synthetic');
DELETE FROM segments WHERE clip NOT IN (SELECT clip FROM clips);
DELETE FROM layouts WHERE layout NOT IN (SELECT layout FROM clips);
DELETE FROM skeletons WHERE skeleton NOT IN (SELECT skeleton FROM clips);
-- A shard may be of several parts ("a+b") or of a whole dataset.
DELETE FROM manifest
WHERE state = 'ok' AND NOT list_has_all(
    (SELECT coalesce(list(part), []) FROM (
        SELECT part FROM clips UNION SELECT part FROM sources UNION SELECT dataset FROM clips)),
    string_split(part, '+'));

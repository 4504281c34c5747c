-- Derived rows of clips that are gone or have moved to another part.
DELETE FROM words WHERE NOT EXISTS (FROM clips c WHERE c.clip = words.clip AND c.part = words.part);
DELETE FROM word_motifs WHERE NOT EXISTS (FROM clips c WHERE c.clip = word_motifs.clip AND c.part = word_motifs.part);
DELETE FROM signatures WHERE clip NOT IN (SELECT clip FROM words);
DELETE FROM segments WHERE clip NOT IN (SELECT clip FROM clips);
DELETE FROM layouts WHERE layout NOT IN (SELECT layout FROM clips);
DELETE FROM skeletons WHERE skeleton NOT IN (SELECT skeleton FROM clips);
DELETE FROM manifest
WHERE state = 'ok' AND part NOT IN (SELECT part FROM clips) AND part NOT IN (SELECT part FROM sources);

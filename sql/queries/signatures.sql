-- name: load_motifs
-- New motifs: their document frequencies are those of the recorded clips as they stand, and stay as they are.
INSERT INTO motifs BY NAME
WITH recorded AS (
    SELECT * FROM word_motifs SEMI JOIN clips c ON c.clip = word_motifs.clip AND c.format <> 'synthetic'
)
SELECT m.motif, $model AS model, m.centroid, count(w.clip)::BIGINT AS words,
    count(DISTINCT w.clip)::BIGINT AS clips, m.strength,
    ln((1 + (SELECT count(DISTINCT clip) FROM recorded)) / (1 + count(DISTINCT w.clip))) + 1 AS idf
FROM read_parquet($motifs) m LEFT JOIN recorded w ON w.motif = m.motif
GROUP BY m.motif, m.centroid, m.strength
ORDER BY m.motif;

-- name: clear_motifs
DELETE FROM motifs;
DELETE FROM word_motifs;
DELETE FROM signatures;
DELETE FROM mirrored_signatures;
DELETE FROM transitions;
DELETE FROM manifest WHERE stage = 'contexts';

-- name: centroids
SELECT centroid FROM motifs ORDER BY motif;

-- name: make_signatures
DELETE FROM signatures WHERE clip IN (SELECT clip FROM clips WHERE part IN (SELECT unnest($parts::VARCHAR[])));
INSERT INTO signatures BY NAME
WITH found AS (FROM word_motifs WHERE part IN (SELECT unnest($parts::VARCHAR[])))
FROM signatures_of(found);

-- name: load_mirrored
DELETE FROM mirrored_signatures WHERE clip IN (SELECT clip FROM clips WHERE part IN (SELECT unnest($parts::VARCHAR[])));
INSERT INTO mirrored_signatures BY NAME
WITH found AS (FROM read_parquet($files) a SEMI JOIN clips c ON c.clip = a.clip AND c.part = a.part)
SELECT * EXCLUDE (words) FROM signatures_of(found);

-- name: corpus_motifs
SELECT model, centroid, idf, strength FROM motifs ORDER BY motif;

-- name: corpus_clips
SELECT clip, dataset, label, subject, split, fps, frames, format = 'synthetic' AS synthetic FROM clips
WHERE ($dataset::VARCHAR IS NULL OR dataset = $dataset) AND clip IN (SELECT clip FROM signatures)
ORDER BY clip;

-- name: corpus_words
SELECT m.clip, m.word, m.motif, w.start, w.stop
FROM word_motifs m JOIN words w USING (clip, word) JOIN clips c USING (clip)
WHERE $dataset::VARCHAR IS NULL OR c.dataset = $dataset
ORDER BY m.clip, m.word;

-- name: words_of_clips
SELECT clip, count(*) AS words FROM word_motifs JOIN clips USING (clip) GROUP BY clip ORDER BY clip;

-- name: motifs_of_words
-- Of all clips between two names.
SELECT motif::USMALLINT AS motif FROM word_motifs JOIN clips USING (clip)
WHERE clip BETWEEN $first AND $last ORDER BY clip, word;

-- name: signature_index
SELECT clip, dataset, label, subject, split, fps, frames, format = 'synthetic' AS synthetic, signature
FROM signatures JOIN clips USING (clip) ORDER BY clip;

-- name: signatures_of
SELECT clip, signature FROM signatures JOIN clips USING (clip)
WHERE $dataset::VARCHAR IS NULL OR dataset = $dataset ORDER BY clip;

-- name: signed_clips
SELECT clip, dataset, part, s.signature, m.signature AS mirrored
FROM clips JOIN signatures s USING (clip) LEFT JOIN mirrored_signatures m USING (clip)
WHERE ($dataset::VARCHAR IS NULL OR dataset = $dataset) AND ($split::VARCHAR IS NULL OR split = $split)
    AND NOT ($recorded_only AND format = 'synthetic') AND good_enough(clip, $min_quality::VARCHAR)
ORDER BY clip;

-- name: mirrored_signature
SELECT signature FROM mirrored_signatures WHERE clip = $clip;

-- name: clip_motifs
SELECT motif, start, stop FROM word_motifs JOIN words USING (clip, word) WHERE clip = $clip ORDER BY word;

-- name: forget_orphans_of_signatures
DELETE FROM signatures WHERE clip NOT IN (SELECT clip FROM words w SEMI JOIN clips c ON c.clip = w.clip AND c.part = w.part);

-- name: forget_orphans_of_mirrored_signatures
DELETE FROM mirrored_signatures WHERE clip NOT IN (SELECT clip FROM words w SEMI JOIN clips c ON c.clip = w.clip AND c.part = w.part);

-- name: searchable
-- Which ways to search have what they compare.
SELECT exists(FROM signatures) AS signature, exists(FROM postures) AS alignment, exists(FROM descriptors) AS descriptor,
    exists(FROM signatures) AS words, exists(FROM submotion_parts) AS submotion,
    exists(FROM manifest WHERE stage = 'moves' AND state = 'ok') AS moves;

-- name: load_words
DELETE FROM words WHERE part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO words BY NAME
FROM read_parquet($files) w SEMI JOIN clips c ON c.clip = w.clip AND c.part = w.part
ORDER BY clip, word;

-- name: load_word_motifs
DELETE FROM word_motifs WHERE part IN (SELECT unnest($parts::VARCHAR[]));
INSERT INTO word_motifs BY NAME
FROM read_parquet($files) a SEMI JOIN clips c ON c.clip = a.clip AND c.part = a.part
ORDER BY clip, word;

-- name: words_per_clip
SELECT clip, part, count(*)::BIGINT AS words FROM words GROUP BY ALL ORDER BY clip;

-- name: recorded_words
-- Words of every recorded clip: what a word network is trained on.
SELECT clip, part, count(*)::BIGINT AS words
FROM words SEMI JOIN clips c ON c.clip = words.clip AND c.format <> 'synthetic'
GROUP BY ALL ORDER BY clip;

-- name: nearest_words
-- For each of some motifs, the word of each of some clips that lies closest to its centroid, closest first.
SELECT w.motif, w.clip, r.start, r.stop
FROM word_motifs w
JOIN (SELECT unnest($clips::VARCHAR[]) AS clip) USING (clip)
JOIN motifs m USING (motif)
JOIN words r USING (clip, word)
JOIN (
    FROM read_parquet($embeddings) f SEMI JOIN manifest p ON p.stage = 'embed' AND p.state = 'ok' AND p.key = f.key
) e ON e.clip = w.clip AND e.word = w.word AND e.part = r.part
WHERE w.motif IN (SELECT unnest($motifs::INTEGER[]))
QUALIFY row_number() OVER (PARTITION BY w.motif, w.clip ORDER BY list_distance(e.embedding, m.centroid), w.word) = 1
ORDER BY w.motif, list_distance(e.embedding, m.centroid), w.clip;

-- name: forget_orphans_of_words
DELETE FROM words WHERE NOT EXISTS (FROM clips c WHERE c.clip = words.clip AND c.part = words.part);

-- name: forget_orphans_of_word_motifs
DELETE FROM word_motifs WHERE NOT EXISTS (FROM clips c WHERE c.clip = word_motifs.clip AND c.part = word_motifs.part);

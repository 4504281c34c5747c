-- For each of some motifs, the word of each of some clips that lies closest to its centroid, closest first.
SELECT w.motif, w.clip, r.start, r.stop
FROM word_motifs w
JOIN (SELECT unnest($clips::VARCHAR[]) AS clip) USING (clip)
JOIN motifs m USING (motif)
JOIN words r USING (clip, word)
JOIN embeddings e USING (clip, word)
WHERE w.motif IN (SELECT unnest($motifs::INTEGER[]))
QUALIFY row_number() OVER (PARTITION BY w.motif, w.clip ORDER BY list_distance(e.embedding, m.centroid), w.word) = 1
ORDER BY w.motif, list_distance(e.embedding, m.centroid), w.clip;

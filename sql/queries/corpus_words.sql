SELECT m.clip, m.word, m.motif, w.start, w.stop
FROM word_motifs m JOIN words w USING (clip, word) JOIN clips c USING (clip)
WHERE $dataset::VARCHAR IS NULL OR c.dataset = $dataset
ORDER BY m.clip, m.word;

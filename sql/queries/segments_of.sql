SELECT s.clip, s.label, s.start, s.stop FROM segments s JOIN clips c USING (clip)
WHERE $dataset::VARCHAR IS NULL OR c.dataset = $dataset ORDER BY s.clip, s.start, s.stop, s.label;

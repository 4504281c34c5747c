SELECT clip, signature FROM signatures JOIN clips USING (clip)
WHERE $dataset::VARCHAR IS NULL OR dataset = $dataset ORDER BY clip;

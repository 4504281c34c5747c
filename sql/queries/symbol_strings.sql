SELECT s.clip, c.dataset, c.label, c.fps, c.frames, c.format = 'synthetic' AS synthetic, s.symbols, s.starts
FROM symbol_strings s JOIN clips c USING (clip)
ORDER BY clip;

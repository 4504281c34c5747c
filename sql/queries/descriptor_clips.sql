SELECT d.clip, c.label, c.dataset, c.seconds, c.format = 'synthetic' AS synthetic, d.descriptor
FROM descriptors d JOIN clips c USING (clip)
ORDER BY clip;

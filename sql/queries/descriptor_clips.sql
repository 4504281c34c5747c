SELECT d.clip, c.label, c.dataset, c.seconds, d.descriptor
FROM descriptors d JOIN clips c USING (clip)
ORDER BY clip;

SELECT clip, dataset, format = 'synthetic' AS synthetic, signature FROM signatures JOIN clips USING (clip) ORDER BY clip;

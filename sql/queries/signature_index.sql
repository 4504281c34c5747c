SELECT clip, dataset, signature FROM signatures JOIN clips USING (clip) ORDER BY clip;

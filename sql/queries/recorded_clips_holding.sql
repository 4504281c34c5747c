SELECT h.rank, h.clip, h.distance, c.label, c.dataset, c.fps, c.frames
FROM clips_holding(
    $descriptor::FLOAT[512], k := $k, within := $within, without := $clip, first := $first, last := $last, real := true
) h
JOIN clips c USING (clip)
ORDER BY rank;

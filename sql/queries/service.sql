-- name: shelf
-- The clips as a grid shows them, and the words that a search of text goes through.
SELECT clip, dataset, label, subject, rig, frames, fps, seconds, licence, format = 'synthetic' AS synthetic, part,
    lower(concat_ws(chr(10), clip, label, subject, licence, array_to_string(map_values(attributes), chr(10)))) AS words
FROM clips ORDER BY clip;

-- name: shelf_verdicts
SELECT clip, verdict_in_dataset AS verdict FROM quality;

-- name: view_is_there
SELECT count(*) > 0 AS there FROM duckdb_views() WHERE view_name = $view;

-- name: motifs_of_clip
SELECT w.start, w.stop, m.motif FROM word_motifs m JOIN words w USING (clip, word) WHERE m.clip = $clip ORDER BY m.word;

-- name: symbols_of_clip
FROM clip_symbols($clip);

-- name: faults_of_clip
SELECT fault, joint, start, stop, severity FROM quality_ranges WHERE clip = $clip ORDER BY start, stop, fault;

-- name: worst_faults
SELECT clip, fault, joint, start, stop, severity FROM quality_unusual
ORDER BY severity DESC NULLS LAST, clip, start, fault, joint LIMIT $k;

-- name: map_of_clips
SELECT clip, x, y FROM clip_map ORDER BY clip;

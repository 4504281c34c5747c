-- name: clip
SELECT * FROM clips WHERE clip = $clip;

-- name: find_clip
FROM find_clip($name);

-- name: clip_names
SELECT clip FROM clips ORDER BY clip;

-- name: count_clips
SELECT count(*)::BIGINT AS clips FROM clips;

-- name: digest_of_clips
-- How many clips there are, and a hash of all their names.
SELECT count(*)::BIGINT AS clips,
    sha256(coalesce(string_agg(strlen(clip) || ':' || clip, '' ORDER BY clip), '')) AS digest
FROM clips;

-- name: clip_lengths
SELECT clip, part, dataset, fps, frames FROM clips WHERE format <> 'synthetic' ORDER BY clip;

-- name: load_clips
INSERT INTO clips BY NAME
SELECT *, frames / fps AS seconds, MAP {} AS attributes FROM rows ORDER BY clip;

-- name: load_layouts
INSERT INTO layouts BY NAME
FROM (SELECT DISTINCT ON (layout) * FROM rows ORDER BY layout) r
ANTI JOIN layouts l ON l.layout = r.layout;

-- name: load_skeletons
INSERT INTO skeletons BY NAME
FROM (SELECT DISTINCT ON (skeleton) * FROM rows ORDER BY skeleton) r
ANTI JOIN skeletons s ON s.skeleton = r.skeleton;

-- name: layout
SELECT * FROM layouts WHERE layout = $layout;

-- name: skeleton
SELECT * FROM skeletons WHERE skeleton = $skeleton;

-- name: parts_of
SELECT clip, dataset, part FROM clips WHERE clip IN (SELECT unnest($clips::VARCHAR[])) ORDER BY clip;

-- name: clips_by_path
SELECT clip, dataset, path FROM clips ORDER BY clip;

-- name: clips_with_parts
SELECT clip, dataset, label, subject, split, fps, frames, format = 'synthetic' AS synthetic, part FROM clips
ORDER BY clip;

-- name: clips_admitted
SELECT clip FROM clips
WHERE ($dataset::VARCHAR IS NULL OR dataset = $dataset) AND ($split::VARCHAR IS NULL OR split = $split)
    AND NOT ($recorded_only AND format = 'synthetic') AND good_enough(clip, $min_quality::VARCHAR);

-- name: clips_without_verdict
SELECT count(*)::BIGINT AS clips FROM clips WHERE quality_verdict(clip) IS NULL;

-- name: clips_good_enough
SELECT clip FROM clips WHERE good_enough(clip, $min_quality::VARCHAR);

-- name: graph_files
SELECT unnest(files) AS file FROM manifest WHERE stage = 'graph' AND state = 'ok' ORDER BY file;

-- name: shortlist_files
SELECT unnest(files) AS file FROM manifest WHERE stage = 'shortlist' AND state = 'ok' ORDER BY file;

-- name: part_clips
SELECT clip FROM clips WHERE part = $part ORDER BY clip;

-- name: part_bodies
-- What checks of recordings have to know beside the frames.
SELECT clip, twist, filled, repaired FROM clips WHERE part = $part ORDER BY clip;

-- name: frames_parts
-- Parts of recorded and of synthetic clips.
SELECT c.part, c.dataset, any_value(m.key) AS key, count(*)::BIGINT AS clips, sum(c.frames)::BIGINT AS frames,
    bool_and(c.format = 'synthetic') AS synthetic
FROM clips c JOIN manifest m ON m.stage IN ('frames', 'synthesize') AND m.part = c.part
GROUP BY ALL ORDER BY c.dataset, c.part;

-- name: keys_of_parts
SELECT part, any_value(key) AS key FROM manifest
WHERE stage IN ('frames', 'synthesize') GROUP BY part;

-- name: content
SELECT clip, content_hash FROM clips ORDER BY clip;

-- name: sample_clips
-- The same clips every time, from all over the lake.
SELECT clip FROM signatures ORDER BY md5(clip) LIMIT $count;

-- name: seconds_of_clips
-- Length of those of some clips that the lake holds, in their order.
SELECT clip, seconds
FROM (SELECT unnest($clips::VARCHAR[]) AS clip, unnest(range(len($clips::VARCHAR[]))) AS position) JOIN clips USING (clip)
ORDER BY position;

-- name: total_seconds
SELECT coalesce(sum(seconds), 0) AS seconds FROM clips;

-- name: recorded_dataset
SELECT dataset FROM clips WHERE dataset = $dataset AND format <> 'synthetic'
UNION SELECT dataset FROM roots WHERE dataset = $dataset;

-- name: dataset_clips
-- Synthetic clips only of a dataset that is named.
SELECT clip, dataset, part, fps, frames, label, subject
FROM clips
WHERE (dataset = $dataset::VARCHAR OR $dataset IS NULL AND format <> 'synthetic') AND ($split::VARCHAR IS NULL OR split = $split)
ORDER BY clip;

-- name: forget_orphans_of_layouts
DELETE FROM layouts WHERE layout NOT IN (SELECT layout FROM clips);

-- name: forget_orphans_of_skeletons
DELETE FROM skeletons WHERE skeleton NOT IN (SELECT skeleton FROM clips);

-- name: clips_of_dataset
SELECT * FROM clips WHERE $dataset::VARCHAR IS NULL OR dataset = $dataset;

-- name: usual_limits
SELECT dataset, fault, joint, highest FROM quality_usual;

-- name: usual_summary
-- One row a fault that is usual in the dataset of some clips.
SELECT DISTINCT dataset, fault, clips, faulty, median FROM quality_usual
WHERE dataset IN (SELECT dataset FROM clips WHERE clip IN (SELECT unnest($clips::VARCHAR[])))
ORDER BY dataset, fault;

-- name: clips_with_quality
-- The same with the row of view quality as a struct; NULL where the stage has not seen the clip as it is now.
SELECT c.*, q AS quality FROM clips c LEFT JOIN quality q ON q.clip = c.clip
WHERE $dataset::VARCHAR IS NULL OR c.dataset = $dataset;

-- name: has_view
SELECT count(*) > 0 FROM duckdb_views() WHERE view_name = $view;

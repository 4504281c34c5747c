-- name: plan_shards
INSERT OR REPLACE INTO manifest BY NAME
SELECT stage, key, part, dataset, 'planned' AS state, NULL AS reason,
    coalesce((SELECT m.attempts FROM manifest m WHERE m.stage = r.stage AND m.key = r.key), 0) AS attempts,
    0 AS rows, 0 AS bytes, spec, [] AS files
FROM rows r;

-- name: finish_shards
-- What a shard read is needed no more once it ended well, but for requests of motion, which nothing else tells.
UPDATE manifest SET state = r.state, reason = r.reason, attempts = manifest.attempts + 1, rows = r.rows,
    bytes = r.bytes, files = r.files, spec = if(r.state = 'ok' AND manifest.stage <> 'synthesize', '{}', spec), seconds = r.seconds, finished = now()::TIMESTAMP
FROM rows r WHERE manifest.stage = r.stage AND manifest.key = r.key;
-- What the same part gave under another configuration is of no use any more.
DELETE FROM manifest USING rows r
WHERE manifest.stage = r.stage AND manifest.part = r.part AND manifest.key <> r.key AND r.state = 'ok';

-- name: shards
SELECT stage, key, part, dataset, state, reason, attempts, spec, files FROM manifest WHERE stage = $stage ORDER BY key;

-- name: done_keys
SELECT key FROM manifest WHERE stage = $stage AND state = 'ok';

-- name: ready_keys
-- What a stage has made; frames are those of synthetic clips too.
SELECT key FROM manifest WHERE state = 'ok' AND (stage = $stage OR ($stage = 'frames' AND stage = 'synthesize'));

-- name: drop_shards
DELETE FROM manifest USING rows r WHERE manifest.stage = r.stage AND manifest.key = r.key;

-- name: failed_shards
SELECT stage, part, attempts, reason FROM manifest WHERE state = 'failed' ORDER BY ALL LIMIT 20;

-- name: unfinished_shards
SELECT stage, key, part, dataset, state, reason, spec FROM manifest
WHERE stage = 'frames' AND dataset = $dataset AND state <> 'ok' ORDER BY key;

-- name: unfinished_of_stage
SELECT key FROM manifest WHERE stage = $stage AND state <> 'ok' ORDER BY key;

-- name: forget_unfinished
-- Shards that a run left when it was cut short, but for those that will be run now.
DELETE FROM manifest
WHERE stage = $stage AND state <> 'ok' AND key NOT IN (SELECT unnest($keys::VARCHAR[]));

-- name: forget_other_shards
-- What a stage made of the lake as it was, where all of it is made together.
DELETE FROM manifest WHERE stage = $stage AND state = 'ok' AND key NOT IN (SELECT unnest($keys::VARCHAR[]));

-- name: forget_orphans_of_manifest
-- A shard may be of several parts ("a+b") or of a whole dataset.
DELETE FROM manifest WHERE (stage, key) IN (
    SELECT (stage, key) FROM (
        SELECT stage, key, unnest(string_split(part, '+')) AS part FROM manifest WHERE state = 'ok'
    ) WHERE part NOT IN (SELECT part FROM clips UNION SELECT part FROM sources UNION SELECT dataset FROM clips)
);

-- name: live_files
SELECT unnest(files) AS file FROM manifest WHERE state = 'ok'
UNION SELECT file FROM models;

-- name: add_run
INSERT INTO runs
SELECT coalesce(max(run), 0) + 1, $command, $ok, $failed, $rejected, $started, $finished FROM runs;

-- name: stage_has_made
SELECT EXISTS (FROM manifest WHERE stage = $stage AND state = 'ok') AS made;

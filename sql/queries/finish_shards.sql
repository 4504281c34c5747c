UPDATE manifest SET state = r.state, reason = r.reason, attempts = manifest.attempts + 1, rows = r.rows,
    bytes = r.bytes, files = r.files, spec = if(r.state = 'ok', '{}', spec), seconds = r.seconds, finished = now()::TIMESTAMP
FROM rows r WHERE manifest.stage = r.stage AND manifest.key = r.key;
-- What the same part gave under another configuration is of no use any more.
DELETE FROM manifest USING rows r
WHERE manifest.stage = r.stage AND manifest.part = r.part AND manifest.key <> r.key AND r.state = 'ok';

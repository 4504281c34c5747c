-- Shards that a run left when it was cut short, but for those that will be run now.
DELETE FROM manifest
WHERE stage = $stage AND state <> 'ok' AND key NOT IN (SELECT unnest($keys::VARCHAR[]));

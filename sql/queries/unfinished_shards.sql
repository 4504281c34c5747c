SELECT stage, key, part, dataset, state, reason, spec FROM manifest
WHERE stage = 'frames' AND dataset = $dataset AND state <> 'ok' ORDER BY key;

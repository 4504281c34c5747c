SELECT stage, key, part, dataset, state, reason, attempts, spec, files FROM manifest WHERE stage = $stage ORDER BY key;

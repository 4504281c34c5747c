SELECT key FROM manifest WHERE stage = $stage AND state <> 'ok' ORDER BY key;

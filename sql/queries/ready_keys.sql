-- What a stage has made; frames are those of synthetic clips too.
SELECT key FROM manifest WHERE state = 'ok' AND (stage = $stage OR ($stage = 'frames' AND stage = 'synthesize'));

-- A part may outlive its use for a moment: only parts the manifest names, and words the lake holds, count.
CREATE OR REPLACE VIEW embeddings AS
SELECT e.clip, e.word, e.embedding
FROM read_parquet(live_files('embeddings', 'embeddings/*.parquet')) e
SEMI JOIN manifest m ON m.stage = 'embed' AND m.state = 'ok' AND m.key = e.key
SEMI JOIN words w ON w.clip = e.clip AND w.word = e.word AND w.part = e.part;

SELECT clip, content_hash FROM clips ORDER BY clip;

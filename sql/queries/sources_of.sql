SELECT path, root, size, mtime_ns, content_hash, config_hash FROM sources WHERE dataset = $dataset;

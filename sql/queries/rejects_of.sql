SELECT path, line, reason FROM rejects WHERE dataset = $dataset ORDER BY path;

UPDATE sources SET size = r.size, mtime_ns = r.mtime_ns
FROM rows r WHERE sources.dataset = r.dataset AND sources.path = r.path;

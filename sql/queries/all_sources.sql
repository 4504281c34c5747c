SELECT dataset, path, root FROM sources ORDER BY dataset, path;

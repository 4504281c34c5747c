SELECT dataset, root, options, labels_hash FROM roots ORDER BY dataset, root;

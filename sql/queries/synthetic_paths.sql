SELECT dataset, path FROM clips WHERE dataset = $dataset AND format = 'synthetic' ORDER BY path;

SELECT dataset FROM clips WHERE dataset = $dataset AND format <> 'synthetic'
UNION SELECT dataset FROM roots WHERE dataset = $dataset;

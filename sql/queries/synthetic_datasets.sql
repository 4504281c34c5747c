SELECT DISTINCT dataset FROM clips WHERE format = 'synthetic' ORDER BY dataset;

SELECT DISTINCT unnest(list_concat(['label', 'subject', 'split', 'dataset'], map_keys(attributes))) AS name
FROM clips ORDER BY name;

SELECT model, kind, key, file, figures FROM models WHERE model = (SELECT model FROM descriptors LIMIT 1);

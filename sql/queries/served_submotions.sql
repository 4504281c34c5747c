SELECT model, kind, key, file, figures FROM models WHERE model = (SELECT model FROM submotions LIMIT 1);

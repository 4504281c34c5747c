SELECT model, kind, version, key, config, figures, file FROM models WHERE kind = $kind AND "current";

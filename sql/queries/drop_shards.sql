DELETE FROM manifest USING rows r WHERE manifest.stage = r.stage AND manifest.key = r.key;

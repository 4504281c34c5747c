-- What training gave was called figures, and a model that came with the program ready made.
UPDATE schema_version SET version = 2;
ALTER TABLE models RENAME COLUMN figures TO metrics;
UPDATE models SET metrics = replace(metrics, '"ready_made":true', '"pretrained":true');

-- Catalogs of version 0 had no version. Frames parts were rewritten before this runs: `rows` are their new sizes.
CREATE TABLE schema_version (
    version INTEGER NOT NULL
);
INSERT INTO schema_version VALUES (1);
UPDATE manifest SET bytes = r.bytes FROM rows r WHERE manifest.stage = r.stage AND manifest.key = r.key;

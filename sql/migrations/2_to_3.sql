-- The catalog lists every file with its size and hashes (`rows`: those that are there), and settings as the last run
-- found them. Views read the files that are listed.
UPDATE schema_version SET version = 3;
CREATE TABLE files (
    file VARCHAR PRIMARY KEY,
    size BIGINT NOT NULL,
    mtime_ns BIGINT NOT NULL,
    crc32 UINTEGER NOT NULL,
    sha256 VARCHAR NOT NULL
);
CREATE TABLE settings (
    file VARCHAR PRIMARY KEY,
    text VARCHAR NOT NULL
);
INSERT INTO files BY NAME FROM rows;

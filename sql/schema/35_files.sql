-- Every file of the lake that the manifest or models name, as it was written: what lies on disk is checked against it.
CREATE TABLE files (
    file VARCHAR PRIMARY KEY,        -- relative to the lake
    size BIGINT NOT NULL,            -- bytes
    mtime_ns BIGINT NOT NULL,        -- when it was written last; tells nothing of what it holds
    crc32 UINTEGER NOT NULL,         -- of its bytes, compared whenever it is read
    sha256 VARCHAR NOT NULL          -- of its bytes, compared by `motionlake verify --deep`
);
-- Settings as the last run found them: people may change them, and are told what has changed.
CREATE TABLE settings (
    file VARCHAR PRIMARY KEY,        -- config.toml, or rigs/NAME.toml
    text VARCHAR NOT NULL
);

-- What was asked to be taken in: one row a source folder, and one a file found in it.
CREATE TABLE roots (
    dataset VARCHAR NOT NULL,
    root VARCHAR NOT NULL,           -- absolute folder
    options VARCHAR NOT NULL,        -- JSON: up, unit, fps, rig, licence, labels, segments, source
    labels_hash VARCHAR NOT NULL,    -- of the label files as they were last entered
    PRIMARY KEY (dataset, root)
);
CREATE TABLE sources (
    dataset VARCHAR NOT NULL,
    path VARCHAR NOT NULL,           -- relative to the root
    root VARCHAR NOT NULL,
    size BIGINT NOT NULL,
    mtime_ns BIGINT NOT NULL,
    content_hash VARCHAR NOT NULL,   -- sha256 of the bytes, companions included
    config_hash VARCHAR NOT NULL,    -- of everything else that shapes the frames
    part VARCHAR NOT NULL,
    PRIMARY KEY (dataset, path)
);
CREATE TABLE rejects (
    dataset VARCHAR NOT NULL,
    path VARCHAR NOT NULL,
    line BIGINT,                     -- 1-based, where the fault has one
    reason VARCHAR NOT NULL,
    content_hash VARCHAR NOT NULL,
    PRIMARY KEY (dataset, path)
);

-- One row a shard of work. Wall-clock columns stand only here, in runs and in models.
CREATE TABLE manifest (
    stage VARCHAR NOT NULL,
    key VARCHAR NOT NULL,            -- sha256 over stage, version, configuration and inputs
    part VARCHAR NOT NULL,           -- the frames part it belongs to
    dataset VARCHAR NOT NULL,
    state VARCHAR NOT NULL CHECK (state IN ('planned', 'ok', 'failed')),
    reason VARCHAR,
    attempts INTEGER NOT NULL,
    rows BIGINT NOT NULL,
    bytes BIGINT NOT NULL,
    spec VARCHAR NOT NULL,           -- JSON: what the shard reads
    files VARCHAR[] NOT NULL,        -- what it wrote, relative to the lake
    seconds DOUBLE,
    finished TIMESTAMP,
    PRIMARY KEY (stage, key)
);
CREATE TABLE models (
    model VARCHAR PRIMARY KEY,       -- kind-version
    kind VARCHAR NOT NULL,           -- network, motifs
    version INTEGER NOT NULL,
    key VARCHAR NOT NULL,            -- sha256 over configuration and, for motifs, the network they live in
    data_hash VARCHAR NOT NULL,      -- of what it was fitted to
    config VARCHAR NOT NULL,         -- JSON
    metrics VARCHAR NOT NULL,        -- JSON: loss, sizes
    file VARCHAR NOT NULL,           -- relative to the lake
    "current" BOOLEAN NOT NULL,
    seconds DOUBLE NOT NULL,
    created TIMESTAMP NOT NULL
);
CREATE TABLE runs (
    run BIGINT PRIMARY KEY,
    command VARCHAR NOT NULL,
    ok BIGINT NOT NULL,
    failed BIGINT NOT NULL,
    rejected BIGINT NOT NULL,
    started TIMESTAMP NOT NULL,
    finished TIMESTAMP NOT NULL
);

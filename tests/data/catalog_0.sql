-- The tables that motionlake made before lakes had versions (version 0), as it stated them.
CREATE TABLE roots (
    dataset VARCHAR NOT NULL,
    root VARCHAR NOT NULL,
    options VARCHAR NOT NULL,
    labels_hash VARCHAR NOT NULL,
    PRIMARY KEY (dataset, root)
);
CREATE TABLE sources (
    dataset VARCHAR NOT NULL,
    path VARCHAR NOT NULL,
    root VARCHAR NOT NULL,
    size BIGINT NOT NULL,
    mtime_ns BIGINT NOT NULL,
    content_hash VARCHAR NOT NULL,
    config_hash VARCHAR NOT NULL,
    part VARCHAR NOT NULL,
    PRIMARY KEY (dataset, path)
);
CREATE TABLE rejects (
    dataset VARCHAR NOT NULL,
    path VARCHAR NOT NULL,
    line BIGINT,
    reason VARCHAR NOT NULL,
    content_hash VARCHAR NOT NULL,
    PRIMARY KEY (dataset, path)
);
CREATE TABLE clips (
    clip VARCHAR PRIMARY KEY,
    dataset VARCHAR NOT NULL,
    path VARCHAR NOT NULL,
    body VARCHAR NOT NULL,
    format VARCHAR NOT NULL,
    rig VARCHAR NOT NULL,
    frames BIGINT NOT NULL,
    fps DOUBLE NOT NULL,
    seconds DOUBLE NOT NULL,
    label VARCHAR,
    subject VARCHAR,
    split VARCHAR,
    attributes MAP(VARCHAR, VARCHAR) NOT NULL,
    licence VARCHAR,
    up VARCHAR NOT NULL,
    metres_per_unit DOUBLE NOT NULL,
    body_height DOUBLE NOT NULL,
    twist BOOLEAN NOT NULL,
    filled VARCHAR[] NOT NULL,
    repaired BIGINT NOT NULL,
    fk_error DOUBLE NOT NULL,
    rest_offsets FLOAT[] NOT NULL,
    layout VARCHAR NOT NULL,
    skeleton VARCHAR NOT NULL,
    notes VARCHAR[] NOT NULL,
    content_hash VARCHAR NOT NULL,
    part VARCHAR NOT NULL
);
CREATE TABLE segments (
    clip VARCHAR NOT NULL,
    start BIGINT NOT NULL,
    stop BIGINT NOT NULL,
    label VARCHAR NOT NULL
);
CREATE TABLE layouts (
    layout VARCHAR PRIMARY KEY,
    kind VARCHAR NOT NULL,
    fixed_axes BOOLEAN NOT NULL,
    joints VARCHAR[] NOT NULL,
    parents INTEGER[] NOT NULL,
    channels VARCHAR[][] NOT NULL
);
CREATE TABLE skeletons (
    skeleton VARCHAR PRIMARY KEY,
    offsets DOUBLE[] NOT NULL,
    axes DOUBLE[] NOT NULL,
    ends DOUBLE[] NOT NULL
);
CREATE TABLE manifest (
    stage VARCHAR NOT NULL,
    key VARCHAR NOT NULL,
    part VARCHAR NOT NULL,
    dataset VARCHAR NOT NULL,
    state VARCHAR NOT NULL CHECK (state IN ('planned', 'ok', 'failed')),
    reason VARCHAR,
    attempts INTEGER NOT NULL,
    rows BIGINT NOT NULL,
    bytes BIGINT NOT NULL,
    spec VARCHAR NOT NULL,
    files VARCHAR[] NOT NULL,
    seconds DOUBLE,
    finished TIMESTAMP,
    PRIMARY KEY (stage, key)
);
CREATE TABLE models (
    model VARCHAR PRIMARY KEY,
    kind VARCHAR NOT NULL,
    version INTEGER NOT NULL,
    key VARCHAR NOT NULL,
    data_hash VARCHAR NOT NULL,
    config VARCHAR NOT NULL,
    figures VARCHAR NOT NULL,
    file VARCHAR NOT NULL,
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
CREATE TABLE words (
    clip VARCHAR NOT NULL,
    word INTEGER NOT NULL,
    start BIGINT NOT NULL,
    stop BIGINT NOT NULL,
    part VARCHAR NOT NULL
);
CREATE TABLE word_motifs (
    clip VARCHAR NOT NULL,
    word INTEGER NOT NULL,
    motif INTEGER NOT NULL,
    part VARCHAR NOT NULL
);
CREATE TABLE motifs (
    motif INTEGER PRIMARY KEY,
    model VARCHAR NOT NULL,
    centroid FLOAT[] NOT NULL,
    words BIGINT NOT NULL,
    clips BIGINT NOT NULL,
    strength DOUBLE NOT NULL,
    idf DOUBLE NOT NULL
);
CREATE TABLE signatures (
    clip VARCHAR PRIMARY KEY,
    words BIGINT NOT NULL,
    signature FLOAT[] NOT NULL
);
CREATE TABLE mirrored_signatures (
    clip VARCHAR PRIMARY KEY,
    signature FLOAT[] NOT NULL
);
CREATE TABLE transitions (
    from_clip VARCHAR NOT NULL,
    from_frame BIGINT NOT NULL,
    from_word INTEGER NOT NULL,
    to_clip VARCHAR NOT NULL,
    to_frame BIGINT NOT NULL,
    to_word INTEGER NOT NULL,
    distance DOUBLE NOT NULL,
    context_distance DOUBLE NOT NULL
);
CREATE TABLE postures (
    symbol INTEGER PRIMARY KEY,
    model VARCHAR NOT NULL,
    code FLOAT[] NOT NULL,
    posture FLOAT[] NOT NULL,
    frames BIGINT NOT NULL,
    share DOUBLE NOT NULL
);
CREATE TABLE symbol_strings (
    clip VARCHAR PRIMARY KEY,
    symbols INTEGER[] NOT NULL,
    starts BIGINT[] NOT NULL,
    part VARCHAR NOT NULL
);
CREATE VIEW posture_distances AS
SELECT a.symbol AS a, b.symbol AS b, list_distance(a.code::DOUBLE[], b.code::DOUBLE[])::FLOAT AS distance
FROM postures a, postures b;
CREATE TABLE descriptors (
    clip VARCHAR PRIMARY KEY,
    descriptor FLOAT[512] NOT NULL,
    model VARCHAR NOT NULL,
    part VARCHAR NOT NULL
);
CREATE TABLE submotions (
    clip VARCHAR NOT NULL,
    start BIGINT NOT NULL,
    stop BIGINT NOT NULL,
    descriptor FLOAT[512] NOT NULL,
    model VARCHAR NOT NULL,
    part VARCHAR NOT NULL,
    PRIMARY KEY (clip, start, stop)
);
CREATE TABLE synthetic (
    clip VARCHAR PRIMARY KEY,
    model VARCHAR NOT NULL,
    config VARCHAR NOT NULL,
    classes VARCHAR[] NOT NULL,
    seconds DOUBLE NOT NULL,
    seed BIGINT NOT NULL,
    number BIGINT NOT NULL,
    pace DOUBLE NOT NULL,
    temperature DOUBLE NOT NULL,
    seed_clip VARCHAR NOT NULL,
    seed_start BIGINT NOT NULL,
    seed_stop BIGINT NOT NULL,
    datasets VARCHAR[] NOT NULL,
    licences VARCHAR[] NOT NULL,
    key VARCHAR NOT NULL
);

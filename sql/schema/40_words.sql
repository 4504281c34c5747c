-- Motion words: half-open ranges of frames at the clip's own rate.
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
-- The current, frozen motifs (Deep Motifs, section 4.1).
CREATE TABLE motifs (
    motif INTEGER PRIMARY KEY,
    model VARCHAR NOT NULL,
    centroid FLOAT[] NOT NULL,
    words BIGINT NOT NULL,           -- of the corpus it was fitted to
    clips BIGINT NOT NULL,           -- that hold it, in that corpus
    strength DOUBLE NOT NULL,        -- density of the cluster
    idf DOUBLE NOT NULL
);
-- tf-idf histograms over the motifs, mass 1 (Deep Motifs, section 4.2).
CREATE TABLE signatures (
    clip VARCHAR PRIMARY KEY,
    words BIGINT NOT NULL,
    signature FLOAT[] NOT NULL
);

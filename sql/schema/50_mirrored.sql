-- Signatures of the clips mirrored left to right, over the same motifs and with the same idf.
CREATE TABLE mirrored_signatures (
    clip VARCHAR PRIMARY KEY,
    signature FLOAT[] NOT NULL
);

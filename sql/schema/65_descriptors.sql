-- One vector a clip (DeepHuMS, section 3.2), of length one; their Euclidean distances are the distances of clips.
CREATE TABLE descriptors (
    clip VARCHAR PRIMARY KEY,
    descriptor FLOAT[512] NOT NULL,
    model VARCHAR NOT NULL,          -- the network that made it, the same in every row
    part VARCHAR NOT NULL
);

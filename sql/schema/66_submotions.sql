-- Windows of clips as the second network sees them (DeepHuMS, section 3.3.5); frames are the clip's own.
CREATE TABLE submotions (
    clip VARCHAR NOT NULL,
    start BIGINT NOT NULL,
    stop BIGINT NOT NULL,
    descriptor FLOAT[512] NOT NULL,
    model VARCHAR NOT NULL,          -- the network that made it, the same in every row
    part VARCHAR NOT NULL,
    PRIMARY KEY (clip, start, stop)
);

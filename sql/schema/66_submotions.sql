-- The parts that hold the windows of clips as the second network sees them (DeepHuMS, section 3.3.5): view `submotions`.
CREATE TABLE submotion_parts (
    part VARCHAR PRIMARY KEY,        -- frames part of the clips
    model VARCHAR NOT NULL           -- the network that made it, the same in every row
);

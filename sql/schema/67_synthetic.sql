-- Lineage of the clips that a generator made (`motionlake synthesize`).
CREATE TABLE synthetic (
    clip VARCHAR PRIMARY KEY,
    model VARCHAR NOT NULL,          -- the generator
    config VARCHAR NOT NULL,         -- its configuration, JSON
    classes VARCHAR[] NOT NULL,      -- wanted, one after the other
    seconds DOUBLE NOT NULL,         -- asked for
    seed BIGINT NOT NULL,            -- of the command
    number BIGINT NOT NULL,          -- of the motion among those of the command, from 1
    pace DOUBLE NOT NULL,
    temperature DOUBLE NOT NULL,
    seed_clip VARCHAR NOT NULL,      -- recorded clip that the motion starts from
    seed_start BIGINT NOT NULL,      -- its frames, at its own rate
    seed_stop BIGINT NOT NULL,
    datasets VARCHAR[] NOT NULL,     -- of the training clips
    licences VARCHAR[] NOT NULL,     -- of the training clips and of the seed clip
    key VARCHAR NOT NULL             -- sha256 over all that the motion follows from
);

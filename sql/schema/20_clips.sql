CREATE TABLE clips (
    clip VARCHAR PRIMARY KEY,        -- dataset/path, with #body where a file holds several
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
    attributes MAP(VARCHAR, VARCHAR) NOT NULL,  -- the other columns of labels.csv
    licence VARCHAR,
    up VARCHAR NOT NULL,             -- of the file; the lake is y up
    metres_per_unit DOUBLE NOT NULL, -- of the file; the lake is in metres
    body_height DOUBLE NOT NULL,     -- metres
    twist BOOLEAN NOT NULL,          -- false: made from positions, rotations about bones are zero
    filled VARCHAR[] NOT NULL,       -- canonical joints that the rig lacks
    repaired BIGINT NOT NULL,        -- frames filled by interpolation
    fk_error DOUBLE NOT NULL,        -- metres, largest distance between stored and rebuilt joints
    rest_offsets FLOAT[] NOT NULL,   -- 21 x 3, metres, canonical rest pose
    layout VARCHAR NOT NULL,         -- of the raw channels
    skeleton VARCHAR NOT NULL,       -- of the file
    notes VARCHAR[] NOT NULL,
    content_hash VARCHAR NOT NULL,
    part VARCHAR NOT NULL            -- the Parquet part that holds its frames
);
-- Frame-level labels, half-open, frames at the clip's own rate; they may overlap.
CREATE TABLE segments (
    clip VARCHAR NOT NULL,
    start BIGINT NOT NULL,
    stop BIGINT NOT NULL,
    label VARCHAR NOT NULL
);
-- Channel layouts of source files; the channels lie in raw/layout=<layout>/*.parquet.
CREATE TABLE layouts (
    layout VARCHAR PRIMARY KEY,
    kind VARCHAR NOT NULL,
    fixed_axes BOOLEAN NOT NULL,
    joints VARCHAR[] NOT NULL,
    parents INTEGER[] NOT NULL,
    channels VARCHAR[][] NOT NULL
);
-- Skeletons of source files, in their own units; clips of one body mostly share one.
CREATE TABLE skeletons (
    skeleton VARCHAR PRIMARY KEY,
    offsets DOUBLE[] NOT NULL,       -- joints of the layout x 3
    axes DOUBLE[] NOT NULL,          -- joints x 4 (quaternions), empty where all are identity
    ends DOUBLE[] NOT NULL           -- (joint, x, y, z) of every end site
);

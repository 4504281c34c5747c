-- The served dictionary of postures (PESTA, section 5.2), with the strings over it.
CREATE TABLE postures (
    symbol INTEGER PRIMARY KEY,
    model VARCHAR NOT NULL,
    code FLOAT[] NOT NULL,           -- cluster head; distances between codes are the distances of symbols
    posture FLOAT[] NOT NULL,        -- a typical posture, as features of one frame
    frames BIGINT NOT NULL,          -- of the lake, at 30 a second, that had it when the dictionary was first served
    share DOUBLE NOT NULL            -- of all of these
);
-- A string a clip (PESTA, section 5): symbols[i] covers the clip's own frames from starts[i] up to starts[i + 1], the
-- last symbol up to the clip's end.
CREATE TABLE symbol_strings (
    clip VARCHAR PRIMARY KEY,
    symbols INTEGER[] NOT NULL,
    starts BIGINT[] NOT NULL,
    part VARCHAR NOT NULL
);
CREATE VIEW posture_distances AS
SELECT a.symbol AS a, b.symbol AS b, list_distance(a.code::DOUBLE[], b.code::DOUBLE[])::FLOAT AS distance
FROM postures a, postures b;

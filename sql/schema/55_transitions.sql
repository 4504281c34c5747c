-- Transitions of motion graphs, both ways; frames at the clip's own rate (Deep Motifs, section 6.4).
CREATE TABLE transitions (
    from_clip VARCHAR NOT NULL,
    from_frame BIGINT NOT NULL,      -- the clip is left here
    from_word INTEGER NOT NULL,
    to_clip VARCHAR NOT NULL,
    to_frame BIGINT NOT NULL,        -- and this one entered here; frames from both on are blended
    to_word INTEGER NOT NULL,
    distance DOUBLE NOT NULL,        -- metres, root mean square over joints and frames
    context_distance DOUBLE NOT NULL -- earth mover's distance between the signatures around both ends
);

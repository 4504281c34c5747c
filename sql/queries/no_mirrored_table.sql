-- For a connection to a lake made before there was such a table: macros bind what they name when they are made.
CREATE TEMP TABLE mirrored_signatures (clip VARCHAR, signature FLOAT[]);

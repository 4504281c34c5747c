-- For a connection to a lake made before there were such tables: macros bind what they name when they are made.
CREATE TEMP TABLE postures (symbol INTEGER, model VARCHAR, code FLOAT[]);
CREATE TEMP TABLE symbol_strings (clip VARCHAR, symbols INTEGER[], starts BIGINT[], part VARCHAR);

-- One row: the version of everything below (docs/lake-format.md). A program reads lakes of its own version alone.
CREATE TABLE schema_version (
    version INTEGER NOT NULL
);

"""Python functions that the macros of a connection call, one module a family, each with `register(con, ...)`."""

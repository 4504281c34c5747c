-- Lakes made before there was such a table have none.
SELECT table_name FROM duckdb_tables() WHERE table_name = 'transitions';

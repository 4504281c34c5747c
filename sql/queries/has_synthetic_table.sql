SELECT 1 AS there FROM duckdb_tables() WHERE table_name = 'synthetic';

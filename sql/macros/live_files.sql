-- The Parquet files of a folder that views read: all that are there. Connections of motionlake replace it by a function
-- that names those the catalog lists, once their bytes are compared with it.
CREATE OR REPLACE MACRO live_files(folder, pattern) AS [pattern];

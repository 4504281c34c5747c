INSERT INTO rejects BY NAME FROM rows ORDER BY dataset, path;

INSERT INTO sources BY NAME FROM rows ORDER BY dataset, path;

DELETE FROM segments WHERE clip IN (SELECT unnest($clips::VARCHAR[]));
INSERT INTO segments BY NAME FROM rows ORDER BY ALL;

DELETE FROM synthetic WHERE clip IN (SELECT clip FROM rows);
INSERT INTO synthetic BY NAME FROM rows ORDER BY clip;

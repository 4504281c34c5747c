INSERT INTO clips BY NAME
SELECT *, frames / fps AS seconds, MAP {} AS attributes FROM rows ORDER BY clip;

INSERT INTO skeletons BY NAME
FROM (SELECT DISTINCT ON (skeleton) * FROM rows ORDER BY skeleton) r
ANTI JOIN skeletons s ON s.skeleton = r.skeleton;

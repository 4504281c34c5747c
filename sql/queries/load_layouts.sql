INSERT INTO layouts BY NAME
FROM (SELECT DISTINCT ON (layout) * FROM rows ORDER BY layout) r
ANTI JOIN layouts l ON l.layout = r.layout;

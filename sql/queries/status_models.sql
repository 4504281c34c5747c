SELECT model, created, round(seconds, 1) AS seconds, figures FROM models WHERE "current" ORDER BY kind;

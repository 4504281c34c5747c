SELECT model, date_trunc('second', created) AS created, round(seconds, 1) AS seconds, figures FROM models WHERE "current" ORDER BY kind;

SELECT unnest(files) AS file FROM manifest WHERE state = 'ok'
UNION SELECT file FROM models;

SELECT coalesce(sum(seconds), 0) AS seconds FROM clips;

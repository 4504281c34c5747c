SELECT model FROM postures LIMIT 1;

SELECT share FROM postures ORDER BY symbol;

SELECT model, code FROM postures ORDER BY symbol;

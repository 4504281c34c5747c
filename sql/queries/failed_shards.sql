SELECT stage, part, attempts, reason FROM manifest WHERE state = 'failed' ORDER BY ALL LIMIT 20;

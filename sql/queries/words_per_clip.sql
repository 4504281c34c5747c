SELECT clip, part, count(*)::BIGINT AS words FROM words GROUP BY ALL ORDER BY clip;

-- Words of every recorded clip: what a word network is trained on.
SELECT clip, part, count(*)::BIGINT AS words
FROM words SEMI JOIN clips c ON c.clip = words.clip AND c.format <> 'synthetic'
GROUP BY ALL ORDER BY clip;

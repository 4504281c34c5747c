-- The nearest words of every word in other clips, as far as both are still in the lake as they were searched.
CREATE OR REPLACE VIEW word_neighbours AS
SELECT n.clip, n.word, n.rank, n.neighbour, n.neighbour_word, n.distance
FROM read_parquet(live_files('neighbours', 'neighbours/*.parquet')) n
SEMI JOIN manifest m ON m.stage = 'neighbours' AND m.state = 'ok' AND m.key = n.key
SEMI JOIN words w ON w.clip = n.clip AND w.word = n.word AND w.part = n.part
SEMI JOIN words o ON o.clip = n.neighbour AND o.word = n.neighbour_word AND o.part = n.neighbour_part;

-- Works in plain DuckDB: the words of other clips nearest to one word under DTW, where they start and stop.
CREATE OR REPLACE MACRO similar_words(query, query_word, k) AS TABLE
SELECT row_number() OVER (ORDER BY n.rank) AS rank, n.neighbour AS clip, n.neighbour_word AS word, n.distance,
    w.start, w.stop
FROM word_neighbours n JOIN words w ON w.clip = n.neighbour AND w.word = n.neighbour_word
WHERE n.clip = query AND n.word = query_word
ORDER BY n.rank LIMIT k;

-- The nearest clips of every clip by each method, as the stage "graph" found them, as far as both are still in the lake.
CREATE OR REPLACE VIEW clip_neighbours AS
WITH listed AS (
    SELECT g.clip, g.method, g.node, unnest(g.neighbours) AS other, unnest(g.distances) AS distance,
        generate_subscripts(g.neighbours, 1) AS rank
    FROM read_parquet(live_files('graph', 'graph/*.parquet')) g
    SEMI JOIN manifest m ON m.stage = 'graph' AND m.state = 'ok' AND m.key = g.key
    SEMI JOIN clips c ON c.clip = g.clip
)
SELECT l.clip, l.method, l.rank, n.clip AS neighbour, l.distance
FROM listed l
JOIN (SELECT DISTINCT node, clip FROM listed) n ON n.node = l.other;

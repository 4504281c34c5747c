-- The same clips every time, from all over the lake.
SELECT clip FROM signatures ORDER BY md5(clip) LIMIT $count;

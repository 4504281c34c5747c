-- Length of those of some clips that the lake holds, in their order.
SELECT clip, seconds
FROM (SELECT unnest($clips::VARCHAR[]) AS clip, unnest(range(len($clips::VARCHAR[]))) AS position) JOIN clips USING (clip)
ORDER BY position;

-- Clips in k clusters (Deep Motifs, section 4.3), numbered from 0, the largest first; NULL takes the best number.
CREATE OR REPLACE TEMP MACRO clip_clusters(k := NULL, within := NULL) AS TABLE
WITH chosen AS (
    SELECT list(clip ORDER BY clip) AS clips, list(signature ORDER BY clip) AS signatures
    FROM signatures JOIN clips USING (clip) WHERE within IS NULL OR dataset = within
), found AS (
    SELECT unnest(clips) AS clip, unnest(cluster_signatures(signatures, k::BIGINT)) AS cluster FROM chosen
)
SELECT clip, cluster, label, dataset FROM found JOIN clips USING (clip) ORDER BY cluster, clip;

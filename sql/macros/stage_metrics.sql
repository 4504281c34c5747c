-- Works in plain DuckDB: what each stage has done so far, and how fast, a row a stage. `work_seconds` are those of the
-- workers, one after the other; `tries_again` counts batches that were run more than once. Of a stage whose batches are
-- of more than one part, as of transitions, clips are not counted.
CREATE OR REPLACE MACRO stage_metrics() AS TABLE
WITH held AS (SELECT part, count(*)::BIGINT AS clips, sum(frames)::BIGINT AS frames FROM clips GROUP BY part),
done AS (
    SELECT m.stage, count(*) FILTER (m.state = 'ok')::BIGINT AS batches,
        count(*) FILTER (m.state = 'failed')::BIGINT AS failed,
        coalesce(sum(greatest(m.attempts - 1, 0)), 0)::BIGINT AS tries_again,
        sum(h.clips) FILTER (m.state = 'ok')::BIGINT AS clips,
        sum(h.frames) FILTER (m.state = 'ok')::BIGINT AS frames,
        sum(m.bytes) FILTER (m.state = 'ok')::BIGINT AS bytes,
        coalesce(sum(m.seconds) FILTER (m.state = 'ok'), 0)::DOUBLE AS work_seconds, max(m.finished) AS finished
    FROM manifest m LEFT JOIN held h ON h.part = m.part
    GROUP BY m.stage
)
SELECT stage, batches, failed, tries_again, clips, frames, coalesce(bytes, 0) AS bytes, work_seconds,
    clips / nullif(work_seconds, 0) AS clips_per_second, frames / nullif(work_seconds, 0) AS frames_per_second, finished
FROM done
ORDER BY stage;

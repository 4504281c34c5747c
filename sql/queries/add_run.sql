INSERT INTO runs
SELECT coalesce(max(run), 0) + 1, $command, $ok, $failed, $rejected, $started, $finished FROM runs;

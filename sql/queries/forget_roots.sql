DELETE FROM roots WHERE dataset = $dataset;
DELETE FROM manifest WHERE stage = 'frames' AND dataset = $dataset AND state <> 'ok';

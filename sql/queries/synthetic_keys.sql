SELECT s.clip, s.key FROM synthetic s JOIN clips c USING (clip) WHERE c.dataset = $dataset;

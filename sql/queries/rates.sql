SELECT clip, fps FROM clips WHERE part = $part ORDER BY clip;

SELECT clip, fps, frames FROM clips WHERE part = $part ORDER BY clip;

SELECT clip, part, dataset, fps, frames FROM clips ORDER BY clip;

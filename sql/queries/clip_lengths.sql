SELECT clip, part, dataset, fps, frames FROM clips WHERE format <> 'synthetic' ORDER BY clip;

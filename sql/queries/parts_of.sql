SELECT clip, dataset, part FROM clips WHERE clip IN (SELECT unnest($clips::VARCHAR[])) ORDER BY clip;

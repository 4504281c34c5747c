SELECT 1 AS there FROM mirrored_signatures WHERE clip = $clip;

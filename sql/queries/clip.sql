SELECT * FROM clips WHERE clip = $clip;

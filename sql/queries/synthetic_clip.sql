SELECT * FROM synthetic WHERE clip = $clip;

SELECT clip FROM signatures WHERE clip = $clip;

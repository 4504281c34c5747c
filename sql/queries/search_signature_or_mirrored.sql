FROM clips_like_either($signature, $mirrored, $k, within := $dataset, real := $real);

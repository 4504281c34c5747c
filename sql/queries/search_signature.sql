FROM clips_like($signature, $k, within := $dataset, real := $real);

FROM similar_or_mirrored_clips($clip, $k, within := $dataset, real := $real);

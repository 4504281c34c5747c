FROM similar_clips($clip, $k, within := $dataset, real := $real);

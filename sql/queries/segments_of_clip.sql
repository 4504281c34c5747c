FROM clip_segments($clip);

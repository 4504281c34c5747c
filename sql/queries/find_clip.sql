FROM find_clip($name);

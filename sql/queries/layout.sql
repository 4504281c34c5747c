SELECT * FROM layouts WHERE layout = $layout;

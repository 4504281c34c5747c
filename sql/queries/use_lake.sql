SET file_search_path = $root;

INSERT OR REPLACE INTO roots VALUES ($dataset, $root, $options, $labels_hash);

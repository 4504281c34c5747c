SELECT file FROM models WHERE model = $model;

SELECT * FROM skeletons WHERE skeleton = $skeleton;

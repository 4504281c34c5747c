SELECT model, centroid, idf, strength FROM motifs ORDER BY motif;

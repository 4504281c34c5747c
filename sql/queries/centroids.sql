SELECT centroid FROM motifs ORDER BY motif;

DELETE FROM motifs;
DELETE FROM word_motifs;
DELETE FROM signatures;

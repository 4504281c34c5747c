DELETE FROM motifs;
DELETE FROM word_motifs;
DELETE FROM signatures;
DELETE FROM mirrored_signatures;
DELETE FROM transitions;
DELETE FROM manifest WHERE stage = 'contexts';

"""What signatures are used for (Deep Motifs, sections 4.3 and 6), as functions on a `Corpus`."""

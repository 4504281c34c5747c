"""Deep Motifs and Motion Signatures: motion words, motifs, signatures, and what they are good for."""

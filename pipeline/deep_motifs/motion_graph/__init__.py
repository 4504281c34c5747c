"""Motion graphs over motion words, held to one context by signatures (Deep Motifs, section 6.4)."""

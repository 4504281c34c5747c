"""Posture dictionaries (PESTA, section 5.2): single frames as symbols, and the distances of the symbols."""

"""PESTA: postures, strings of posture symbols, and their strided temporal alignment."""

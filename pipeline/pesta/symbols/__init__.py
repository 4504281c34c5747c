"""Symbol strings of clips: posture symbols without temporal redundancy (PESTA, section 5.3)."""

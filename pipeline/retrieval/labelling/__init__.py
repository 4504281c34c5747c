"""Labels for a lake's clips: along them, as a whole, and without any to learn from."""

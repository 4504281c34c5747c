"""Damage on purpose, at any size: `python -m bench.fuzz`."""

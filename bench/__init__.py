"""Measurements against public packages, and the files that record them."""

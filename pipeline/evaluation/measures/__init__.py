"""Measures of how well a method retrieves, labels and segments."""

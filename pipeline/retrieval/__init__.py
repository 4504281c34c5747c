"""Answers from a lake: searchers, labelling, duplicates, composing, and the SQL functions over them."""

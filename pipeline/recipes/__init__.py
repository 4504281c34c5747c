"""Datasets that others publish: a recipe each, downloads that resume, archives that are unpacked safely."""

"""GloGen: sparse poses of a class from a few sparse poses (chapter 4, first stage)."""

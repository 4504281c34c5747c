"""New motion of wanted classes, from sparse poses to dense frames (GloGen and LocGen, chapter 4)."""

"""What writes clips as files that other programs read."""

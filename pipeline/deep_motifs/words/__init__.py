"""Motion words: features, windows, their distances, and the network that embeds them."""

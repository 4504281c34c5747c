"""How good the answers of a labelled lake are, by the protocols of the papers."""

"""Motion descriptors (DeepHuMS): one vector a clip, for retrieval in one look-up."""

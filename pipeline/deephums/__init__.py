"""DeepHuMS: one vector a clip, and vectors of the windows of clips."""

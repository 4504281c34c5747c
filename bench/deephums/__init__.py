"""DeepHuMS measured beside published descriptors of motion, in one harness."""

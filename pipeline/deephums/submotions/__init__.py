"""The sub-motion encoder: vectors of pieces of clips (DeepHuMS, section 3.3.5)."""

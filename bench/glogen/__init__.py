"""Synthesis of motion (chapter 4) beside the methods it is compared with, on the same data, budget and search."""

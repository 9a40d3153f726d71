"""Grains of one scan found again in a later scan of the same sample, and how they moved."""

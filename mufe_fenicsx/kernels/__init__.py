"""Compiled loops: arrays in, arrays changed. Nothing here imports the package."""

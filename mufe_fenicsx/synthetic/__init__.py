"""Synthetic scans of sand whose grains and contacts are known."""

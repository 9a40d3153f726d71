"""Loops of packings of rigid grains, and of radial shapes."""

"""Loops of tetrahedra, nodes and rigid grains."""

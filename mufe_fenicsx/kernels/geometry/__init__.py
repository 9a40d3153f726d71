"""Loops of meshing and of surfaces."""

"""Tetrahedra inside surfaces, and those of other programs."""

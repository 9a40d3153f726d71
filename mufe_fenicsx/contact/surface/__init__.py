"""Surfaces that may touch: facets, points of contact, and the ghosts of other ranks."""

"""A reference of its own: axisymmetric finite elements with contact."""

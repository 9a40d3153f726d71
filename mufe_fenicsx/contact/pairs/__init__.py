"""Which points, facets and edges are near each other, and for how long that is known."""

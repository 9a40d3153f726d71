"""Bodies with formulas: balls, cylinders, ellipsoids, boxes."""

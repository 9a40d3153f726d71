"""Error against cost, measured over all choices of model: points, the grid of them, figures."""

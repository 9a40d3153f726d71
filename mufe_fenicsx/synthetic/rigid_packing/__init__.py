"""Packings of rigid grains by gravity or compression, with friction: what `mufe pack` does."""

"""What grains do inside: tetrahedra that deform, rigid grains, tangents, masses."""

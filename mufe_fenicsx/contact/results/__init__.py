"""What contact hands on: the network of grains, fields of nodes, dissipation."""

"""Materials of grains: frozen parameters and a law."""

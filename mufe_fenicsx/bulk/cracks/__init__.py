"""Grains that break."""

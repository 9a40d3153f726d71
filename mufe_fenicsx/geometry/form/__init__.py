"""Shapes of grains as numbers."""

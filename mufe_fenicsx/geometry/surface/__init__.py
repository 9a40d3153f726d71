"""Surfaces of grains as triangles."""

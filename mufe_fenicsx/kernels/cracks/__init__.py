"""Loops over facets that open."""

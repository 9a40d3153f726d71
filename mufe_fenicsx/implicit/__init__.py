"""Increments to equilibrium, or through time: their equations and their linear systems."""

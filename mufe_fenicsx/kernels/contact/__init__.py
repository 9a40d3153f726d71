"""Loops and C of contact: search, law, tangents."""

"""The start of contact: overlaps, checks, and the shape without forces."""

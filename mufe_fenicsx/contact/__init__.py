"""Frictional contact between deformable grains and with rigid walls.

Sign convention: a gap g > 0 is open, and the normal points from the facet to the node.
"""

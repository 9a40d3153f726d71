"""Grains, labels and tests for other programs: Fiji, SPAM, CalculiX and Abaqus, YADE, LS-DEM.

Lengths are written in metres where the format of the peer leaves that open.
"""

"""Material parameters from tests of single grains: pressed, rubbed, crushed."""

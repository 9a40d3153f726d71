"""Steps in time by central differences: the stable step, its schedule, added mass."""

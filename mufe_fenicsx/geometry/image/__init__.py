"""Images: their files, thresholds, and grains as labels."""

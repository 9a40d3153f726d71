"""Springs of contact as matrices."""

"""Springs of contact as matrices, and exact gaps."""

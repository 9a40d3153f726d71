"""What a run writes: fields, history, contacts, checkpoints."""

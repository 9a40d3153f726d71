"""The machine that computes: memory, caches, the MPI launcher."""

"""Batches, solvers, derivatives and worlds. Their public names are those of `stiction` itself."""

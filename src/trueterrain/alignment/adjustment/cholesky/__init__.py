"""Sparse Cholesky factorisation of the normal matrix."""

"""Statistics of correlated errors: effective number, intervals, regression."""

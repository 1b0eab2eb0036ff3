"""The processing and Table 3-1 of the 2009 thesis."""

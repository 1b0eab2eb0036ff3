"""Discontinuity vectors of the 2009 thesis: corrections of two passes along a reference path."""

"""Tests of whole chains: from a recorded run to motion, surface and profile."""

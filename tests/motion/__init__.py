"""Tests of motion, with helpers of their own."""

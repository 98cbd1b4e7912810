"""Measurements behind the numbers in the documentation; run from a checkout, never as tests."""

"""Slow, independent oracles that the fast code is tested against, and the catalogue of hard cases."""

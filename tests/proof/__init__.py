"""Slow, independent oracles to test the fast code against, and the catalogue of hard cases."""

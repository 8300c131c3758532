"""Slow, independent judges of what the fast code says, and the catalogue of hard cases."""

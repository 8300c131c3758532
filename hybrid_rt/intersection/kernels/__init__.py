"""Compiled searches for first hits."""

"""Rays that are hard to decide, the catalogue of hard cases, and campaigns over them."""

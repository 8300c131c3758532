"""Judges of hits, which share no code with the tracer, and the catalogue of hard cases."""

"""Exact ray tracing of curved surfaces."""

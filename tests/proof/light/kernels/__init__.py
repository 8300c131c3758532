"""Compiled loop of the independent light tracer."""

"""Surfaces and their certified tessellation."""
